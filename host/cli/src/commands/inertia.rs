//! `darm inertia`: mass, centre of mass and inertia tensor of a solid of simple shape or of a mesh.

use std::path::PathBuf;

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, Twist};
use darm_core::tree::Inertia as Distribution;
use darm_robot::rigid_body::solid::Solid;
use serde::Serialize;

use crate::failure::Usage;
use crate::number_text::numbers;
use crate::ui::{Answer, Ui, columns, number};

const EXAMPLES: &str = "\
Examples:
  darm inertia box --size 100,200,300 --mass 2
  darm inertia cylinder --size 20,300 --density 2700   # an aluminium rod
  darm inertia tube --size 20,18,300 --density 2700 --at 0,0,150 --rotation 0,90,0   # placed
  darm inertia mesh --mesh wedge.obj --scale 0.001 --density 1200   # a mesh in mm

--size in mm: box EDGE,EDGE,EDGE; sphere RADIUS; ellipsoid HALF,HALF,HALF; cylinder RADIUS,LENGTH; capsule \
RADIUS,LENGTH of the cylinder between its half balls; cone RADIUS,HEIGHT; tube OUTER,INNER,LENGTH. Cylinder, capsule, cone and \
tube are along z. A shape is about its centre, a cone about the middle of its base. Products of inertia have the sign of the \
tensor, Ixy = -∫xy dm, as in URDF and MJCF.";

/// Compute mass, centre of mass and inertia tensor of a solid of constant density
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
#[command(group = clap::ArgGroup::new("amount").args(["mass", "density"]).required(true))]
pub(crate) struct Inertia {
    /// Shape of the solid
    #[arg(value_name = "SHAPE")]
    shape: Shape,
    /// Its sizes, mm
    #[arg(long, value_name = "MM,…", required_unless_present = "mesh", conflicts_with = "mesh")]
    size: Option<String>,
    /// Mesh file of the shape `mesh`: binary STL, OBJ or MSH, a closed surface
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Metres per unit of length of the mesh file
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, requires = "mesh")]
    scale: f64,
    /// Mass, kg
    #[arg(long, value_name = "KG")]
    mass: Option<f64>,
    /// Density, kg/m³
    #[arg(long, value_name = "KG_M3")]
    density: Option<f64>,
    /// Position of the shape in the frame of its link, mm
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, default_value = "0,0,0")]
    at: String,
    /// Orientation of the shape in the frame of its link: a rotation vector, deg
    #[arg(long, value_name = "RX,RY,RZ", allow_hyphen_values = true, default_value = "0,0,0")]
    rotation: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
enum Shape {
    Box,
    Sphere,
    Ellipsoid,
    Cylinder,
    Capsule,
    Cone,
    Tube,
    Mesh,
}

#[derive(Serialize)]
struct Report {
    shape: Shape,
    volume_m3: f64,
    density_kg_m3: f64,
    mass_kg: f64,
    /// In the frame of the link.
    com_m: [f64; 3],
    /// About the centre of mass, along the axes of the link.
    inertia_kg_m2: [[f64; 3]; 3],
    /// About the origin of the link.
    inertia_about_origin_kg_m2: [[f64; 3]; 3],
    /// Smallest first.
    principal_moments_kg_m2: [f64; 3],
}

impl Inertia {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let solid = self.solid()?;
        let three = |text: &str, option: &str| -> Result<Vec3<f64>, Usage> {
            let wrong = |_| Usage(format!("{option} {text}: give three numbers"));
            Ok(Vec3::from(<[f64; 3]>::try_from(numbers(text, option)?).map_err(wrong)?))
        };
        let turn = three(&self.rotation, "--rotation")?.map(f64::to_radians);
        let rotation = Pose::exp(&Twist { angular: turn, linear: Vec3::zeros() }).rotation;
        let position = three(&self.at, "--at")? * 1e-3;
        let body = match (self.mass, self.density) {
            (Some(mass), _) => solid.with_mass(positive(mass, "--mass")?),
            (None, density) => solid.with_density(positive(density.unwrap_or(f64::NAN), "--density")?),
        };
        ui.print(&Report::new(self.shape, &solid, &body.placed(&rotation, &position)))
    }

    fn solid(&self) -> anyhow::Result<Solid> {
        if let Some(path) = &self.mesh {
            if self.shape != Shape::Mesh {
                return Err(Usage("--mesh needs the shape `mesh`".into()).into());
            }
            return Ok(Solid::read(path, positive(self.scale, "--scale")?)?);
        }
        let text = self.size.as_deref().unwrap_or_default();
        let size: Vec<f64> = numbers(text, "--size")?.iter().map(|mm| 1e-3 * mm).collect();
        if let Some(wrong) = size.iter().find(|size| **size <= 0.0) {
            return Err(Usage(format!("--size: {} mm is not a length; give sizes above 0", 1e3 * wrong)).into());
        }
        match (self.shape, &size[..]) {
            (Shape::Box, &[a, b, c]) => Ok(Solid::cuboid([a, b, c])),
            (Shape::Sphere, &[radius]) => Ok(Solid::sphere(radius)),
            (Shape::Ellipsoid, &[a, b, c]) => Ok(Solid::ellipsoid([a, b, c])),
            (Shape::Cylinder, &[radius, length]) => Ok(Solid::cylinder(radius, length)),
            (Shape::Capsule, &[radius, length]) => Ok(Solid::capsule(radius, length)),
            (Shape::Cone, &[radius, height]) => Ok(Solid::cone(radius, height)),
            (Shape::Tube, &[outer, inner, length]) if inner < outer => Ok(Solid::tube(outer, inner, length)),
            (shape, _) => Err(Usage(format!("--size {text}: {}", shape.sizes())).into()),
        }
    }
}

impl Shape {
    /// Which sizes it takes.
    fn sizes(self) -> &'static str {
        match self {
            Self::Box => "a box has three edges, such as 100,200,300",
            Self::Sphere => "a sphere has one radius, such as 50",
            Self::Ellipsoid => "an ellipsoid has three half axes, such as 50,60,70",
            Self::Cylinder | Self::Capsule => "give radius and length, such as 20,300",
            Self::Cone => "a cone has a radius and a height, such as 20,300",
            Self::Tube => "a tube has an outer radius, a smaller inner one and a length, such as 20,18,300",
            Self::Mesh => "a mesh has no sizes; give --mesh FILE",
        }
    }
}

fn positive(value: f64, option: &str) -> Result<f64, Usage> {
    if value > 0.0 && value <= 1e12 {
        return Ok(value);
    }
    Err(Usage(format!("{option} {value}: give a number above 0 and at most 1e12")))
}

impl Report {
    fn new(shape: Shape, solid: &Solid, body: &Distribution<f64>) -> Self {
        let rows = |matrix: &Mat3<f64>| std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]));
        let mut moments: [f64; 3] = body.about_com.symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        Self {
            shape,
            volume_m3: solid.volume_m3,
            density_kg_m3: body.mass / solid.volume_m3,
            mass_kg: body.mass,
            com_m: body.com.into(),
            inertia_kg_m2: rows(&body.about_com),
            inertia_about_origin_kg_m2: rows(&body.about_origin().to_matrix()),
            principal_moments_kg_m2: moments,
        }
    }

    /// The element of a URDF.
    fn urdf(&self) -> String {
        let [x, y, z] = self.com_m;
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = self.inertia_kg_m2;
        format!(
            "<inertial>\n  <origin xyz=\"{x} {y} {z}\"/>\n  <mass value=\"{}\"/>\n  \
             <inertia ixx=\"{xx:.9e}\" ixy=\"{xy:.9e}\" ixz=\"{xz:.9e}\" iyy=\"{yy:.9e}\" iyz=\"{yz:.9e}\" izz=\"{zz:.9e}\"/>\n</inertial>",
            self.mass_kg
        )
    }
}

impl Answer for Report {
    fn text(&self) -> String {
        let mm = self.com_m.map(|x| number(1e3 * x, 3)).join(" ");
        let table = |rows: &[[f64; 3]; 3]| columns(&rows.map(|row| row.map(|x| format!("{x:.6e}")).to_vec()));
        format!(
            "mass {} kg, volume {} cm³, density {} kg/m³, centre of mass {mm} mm\n\n\
             inertia about the centre of mass, kg m²\n{}\n\ninertia about the origin of the link, kg m²\n{}\n\n\
             principal moments, kg m²: {}\n\nfor a URDF, in m, kg and kg m²:\n{}",
            number(self.mass_kg, 4),
            number(1e6 * self.volume_m3, 3),
            number(self.density_kg_m3, 1),
            table(&self.inertia_kg_m2),
            table(&self.inertia_about_origin_kg_m2),
            self.principal_moments_kg_m2.map(|moment| format!("{moment:.6e}")).join(" "),
            self.urdf()
        )
    }
}
