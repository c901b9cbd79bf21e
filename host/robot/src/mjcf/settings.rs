//! What `<compiler>` and `<option>` say of the complete model: units, conventions, how inertia is found, gravity.

use darm_core::real::Vec3;

use super::fault::Wrong;
use super::files::Part;

/// Settings of a model; of an attribute that is given twice the later value counts.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    /// rad per unit of an angle.
    pub(super) angle_rad: f64,
    /// Three axes; those in capitals are fixed.
    pub(super) euler_sequence: [char; 3],
    pub(super) autolimits: bool,
    pub(super) inertia_from_geom: FromGeom,
    pub(super) inertia_groups: [f64; 2],
    pub(super) balance_inertia: bool,
    pub(super) bound_mass_kg: f64,
    pub(super) bound_inertia_kg_m2: f64,
    pub(super) total_mass_kg: Option<f64>,
    pub(super) mesh_folder: String,
    pub(super) strip_path: bool,
    pub(super) align_free: bool,
    pub(super) gravity: Vec3<f64>,
}

/// Whether inertia is that of the geoms of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FromGeom {
    Never,
    Always,
    WhereNotGiven,
}

impl Settings {
    pub(super) fn of(root: Part<'_>) -> Result<Self, Wrong> {
        let mut settings = Self {
            angle_rad: std::f64::consts::PI / 180.0,
            euler_sequence: ['x', 'y', 'z'],
            autolimits: true,
            inertia_from_geom: FromGeom::WhereNotGiven,
            inertia_groups: [0.0, 5.0],
            balance_inertia: false,
            bound_mass_kg: 0.0,
            bound_inertia_kg_m2: 0.0,
            total_mass_kg: None,
            mesh_folder: String::new(),
            strip_path: false,
            align_free: false,
            gravity: Vec3::new(0.0, 0.0, -9.81),
        };
        let mut is_weightless = false;
        for part in root.children() {
            match part.tag() {
                "compiler" => settings.compile(part)?,
                "option" => {
                    if let Some(gravity) = numbers(part, "gravity", "three finite numbers")? {
                        settings.gravity = gravity.into();
                    }
                    is_weightless |= part.named("flag").any(|flag| flag.value("gravity") == Some("disable"));
                }
                _ => {}
            }
        }
        if is_weightless {
            settings.gravity = Vec3::zeros();
        }
        Ok(settings)
    }

    fn compile(&mut self, part: Part<'_>) -> Result<(), Wrong> {
        for attribute in part.attributes() {
            let wrong = |expected| part.wrong_value(attribute, expected);
            let is_true = || match attribute.value.as_str() {
                "true" => Ok(true),
                "false" => Ok(false),
                _ => Err(wrong("true or false")),
            };
            let number = || match attribute.numbers().as_deref() {
                Some([number]) => Ok(*number),
                _ => Err(wrong("a finite number")),
            };
            match attribute.name.as_str() {
                "angle" => {
                    self.angle_rad = match attribute.value.as_str() {
                        "radian" => 1.0,
                        "degree" => std::f64::consts::PI / 180.0,
                        _ => return Err(wrong("degree or radian")),
                    };
                }
                "coordinate" if attribute.value != "local" => {
                    return Err(part.unsupported("coordinate=\"global\"", "save the model with local coordinates"));
                }
                "eulerseq" => {
                    let axes = attribute.value.chars().filter(|c| "xyzXYZ".contains(*c)).collect::<Vec<_>>();
                    self.euler_sequence = axes.try_into().map_err(|_| wrong("three of x y z X Y Z"))?;
                }
                "autolimits" => self.autolimits = is_true()?,
                "inertiafromgeom" => {
                    self.inertia_from_geom = match attribute.value.as_str() {
                        "auto" => FromGeom::WhereNotGiven,
                        _ if is_true().map_err(|_| wrong("true, false or auto"))? => FromGeom::Always,
                        _ => FromGeom::Never,
                    };
                }
                "inertiagrouprange" => {
                    let groups = numbers(part, "inertiagrouprange", "two finite numbers")?;
                    self.inertia_groups = groups.unwrap_or(self.inertia_groups);
                }
                "balanceinertia" => self.balance_inertia = is_true()?,
                "boundmass" => self.bound_mass_kg = number()?,
                "boundinertia" => self.bound_inertia_kg_m2 = number()?,
                "settotalmass" => self.total_mass_kg = Some(number()?).filter(|mass| *mass > 0.0),
                "meshdir" => self.mesh_folder.clone_from(&attribute.value),
                "assetdir" if part.attribute("meshdir").is_none() => self.mesh_folder.clone_from(&attribute.value),
                "strippath" => self.strip_path = is_true()?,
                "alignfree" => self.align_free = is_true()?,
                _ => {}
            }
        }
        Ok(())
    }
}

fn numbers<const N: usize>(part: Part<'_>, name: &str, expected: &'static str) -> Result<Option<[f64; N]>, Wrong> {
    let Some(attribute) = part.attribute(name) else { return Ok(None) };
    let found = attribute.numbers().and_then(|numbers| numbers.try_into().ok());
    found.map(Some).ok_or_else(|| part.wrong_value(attribute, expected))
}
