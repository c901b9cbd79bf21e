//! Files of triangles: binary STL, OBJ and MuJoCo's MSH, whose numbers have single precision.

use std::path::Path;

use darm_core::real::Vec3;

/// Corners, and three of them for each face.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Surface {
    pub(crate) vertices: Vec<Vec3<f64>>,
    pub(crate) faces: Vec<[usize; 3]>,
}

impl Surface {
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [Vec3<f64>; 3]> {
        self.faces.iter().map(|face| face.map(|vertex| self.vertices[vertex]))
    }
}

/// The surface of a file, by the end of its name.
pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<Surface, String> {
    let end = path.extension().map(|end| end.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let surface = match end.as_str() {
        "stl" => stl(bytes),
        "obj" => obj(&String::from_utf8_lossy(bytes)),
        "msh" => msh(bytes),
        _ => return Err(format!("a mesh of the type `{end}`, this program reads stl, obj and msh; convert it")),
    };
    let surface = surface.ok_or_else(|| format!("the file is no {end} with triangles; export it again"))?;
    let is_known = surface.faces.iter().flatten().all(|&vertex| vertex < surface.vertices.len());
    let is_finite = surface.vertices.iter().all(|vertex| vertex.iter().all(|x| x.is_finite()));
    if is_known && is_finite {
        Ok(surface)
    } else {
        Err("a face of vertices that the file does not have; export it again".into())
    }
}

fn float(bytes: &[u8], at: usize) -> Option<f64> {
    Some(f32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?).into())
}

fn count(bytes: &[u8], at: usize) -> Option<usize> {
    let number = i32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?);
    usize::try_from(number).ok()
}

fn vertex(bytes: &[u8], at: usize) -> Option<Vec3<f64>> {
    Some(Vec3::new(float(bytes, at)?, float(bytes, at + 4)?, float(bytes, at + 8)?))
}

/// 80 bytes, the number of triangles, and 50 bytes for each: normal, three corners, two bytes.
fn stl(bytes: &[u8]) -> Option<Surface> {
    let triangles = count(bytes, 80)?;
    if triangles == 0 || bytes.len() < triangles.checked_mul(50)?.checked_add(84)? {
        return None;
    }
    let corners = (0..triangles).flat_map(|triangle| (0..3).map(move |corner| 84 + 50 * triangle + 12 + 12 * corner));
    let vertices = corners.map(|at| vertex(bytes, at)).collect::<Option<Vec<_>>>()?;
    Some(Surface { vertices, faces: (0..triangles).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect() })
}

/// Lines `v x y z` and `f a b c …` with numbers that count from 1, or back from the last where they are negative.
fn obj(text: &str) -> Option<Surface> {
    let mut surface = Surface::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut number = || words.next()?.parse::<f32>().ok().map(f64::from);
                surface.vertices.push(Vec3::new(number()?, number()?, number()?));
            }
            Some("f") => {
                let last = surface.vertices.len();
                let corner = |word: &str| match word.split('/').next()?.parse::<isize>().ok()? {
                    0 => None,
                    back @ ..0 => last.checked_sub(back.unsigned_abs()),
                    number => Some(number.unsigned_abs() - 1),
                };
                let corners = words.map(corner).collect::<Option<Vec<_>>>()?;
                surface.polygon(&corners)?;
            }
            _ => {}
        }
    }
    (!surface.faces.is_empty()).then_some(surface)
}

impl Surface {
    /// A polygon as triangles; of four corners along the shorter diagonal, of more as a fan.
    fn polygon(&mut self, corners: &[usize]) -> Option<()> {
        let distance = |a: usize, b: usize| Some((self.vertices.get(a)? - self.vertices.get(b)?).norm_squared());
        match *corners {
            [a, b, c, d] if distance(a, c)? >= distance(b, d)? => self.faces.extend([[a, b, d], [b, c, d]]),
            [first, ref rest @ ..] => self.faces.extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]])),
            [] => {}
        }
        Some(())
    }
}

/// Four counts, of vertices, normals, texture coordinates and faces; then these in single precision and integers.
fn msh(bytes: &[u8]) -> Option<Surface> {
    let [vertices, normals, texture, faces] = [count(bytes, 0)?, count(bytes, 4)?, count(bytes, 8)?, count(bytes, 12)?];
    let first = 16 + 12_usize.checked_mul(vertices)? + 12_usize.checked_mul(normals)? + 8_usize.checked_mul(texture)?;
    if faces == 0 || bytes.len() < first.checked_add(faces.checked_mul(12)?)? {
        return None;
    }
    let vertices = (0..vertices).map(|k| vertex(bytes, 16 + 12 * k)).collect::<Option<Vec<_>>>()?;
    let corner = |at: usize| count(bytes, at);
    let face = |k: usize| Some([0, 4, 8].map(|byte| corner(first + 12 * k + byte).unwrap_or(usize::MAX)));
    Some(Surface { vertices, faces: (0..faces).map(face).collect::<Option<Vec<_>>>()? })
}
