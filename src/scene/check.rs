//! The invariants of a [`Scene`].

use super::{Geometry, InstanceId, Mesh, Scene};

/// Describes the first broken invariant of a scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Broken(pub String);

impl Scene {
    /// Checks the invariants: indices in range, no empty mesh or geometry, triangles numbered consecutively through
    /// each mesh, referenced positions and transforms finite, and for each alpha test an image and one texture
    /// coordinate per vertex.
    ///
    /// # Errors
    /// The first broken promise of the fields' descriptions.
    pub fn check(&self) -> Result<(), Broken> {
        for (i, mesh) in self.meshes.iter().enumerate() {
            check_mesh(mesh, self.materials.len(), self.images.len())
                .map_err(|e| Broken(format!("mesh {i} `{}`: {e}", mesh.name)))?;
        }
        for (i, instance) in self.instances.iter().enumerate() {
            let broken = |what: &str| Err(Broken(format!("instance {i} `{}`: {what}", instance.name)));
            if instance.mesh.0 as usize >= self.meshes.len() {
                return broken("places a mesh that is not there");
            }
            if !instance.transform.is_finite() {
                return broken("has a transform that is not finite");
            }
            if !self.stands_in_soundly(InstanceId(i as u32)) {
                return broken("stands in for a mesh that it is not a copy of");
            }
        }
        Ok(())
    }
}

impl Scene {
    /// Whether the mesh that an instance's mesh stands in for exists and has the same number of triangles.
    fn stands_in_soundly(&self, instance: InstanceId) -> bool {
        let Some(stand_in) = self.stand_in(instance) else { return true };
        let Some(copy) = self.meshes.get(stand_in.copy.0 as usize) else { return false };
        let count = self.mesh_of(instance).triangle_count();
        let ordered = stand_in.order.as_ref().map_or(count, |o| o.runs().iter().map(|r| r[1] as usize).sum());
        let within = |run: &[u32; 2]| run[0] as usize + run[1] as usize <= count;
        let sound = stand_in.order.as_ref().is_none_or(|o| o.runs().iter().all(within));
        copy.triangle_count() == count && ordered == count && sound
    }
}

fn check_mesh(mesh: &Mesh, materials: usize, images: usize) -> Result<(), String> {
    if mesh.geometries.is_empty() {
        return Err("has no geometry".into());
    }
    let mut first = 0;
    for (i, geometry) in mesh.geometries.iter().enumerate() {
        if geometry.first_triangle as usize != first {
            return Err(format!("geometry {i} does not start at triangle {first}"));
        }
        first += geometry.triangles.len();
        check_geometry(geometry, materials)
            .and_then(|()| check_alpha(geometry, images))
            .map_err(|e| format!("geometry {i} {e}"))?;
    }
    Ok(())
}

fn check_geometry(geometry: &Geometry, materials: usize) -> Result<(), String> {
    if geometry.triangles.is_empty() {
        return Err("is empty".into());
    }
    if geometry.material.is_some_and(|m| m as usize >= materials) {
        return Err("has a material that is not there".into());
    }
    if geometry.kept.as_ref().is_some_and(|k| k.len() != geometry.triangles.len()) {
        return Err("does not tell the source of every triangle".into());
    }
    if geometry.residuals.as_ref().is_some_and(|r| r.len() != geometry.positions.len()) {
        return Err("does not tell the residual of every position".into());
    }
    for (t, corners) in geometry.triangles.iter().enumerate() {
        for &v in corners {
            match geometry.positions.get(v as usize) {
                None => return Err(format!("triangle {t} has vertex {v} of {}", geometry.positions.len())),
                Some(p) if !p.is_finite() => return Err(format!("triangle {t} has a corner that is not finite")),
                Some(_) => {}
            }
        }
    }
    Ok(())
}

fn check_alpha(geometry: &Geometry, images: usize) -> Result<(), String> {
    let Some(texture) = geometry.alpha.as_ref().and_then(|alpha| alpha.texture.as_ref()) else { return Ok(()) };
    if texture.image as usize >= images {
        return Err("has an image that is not there".into());
    }
    match texture.texcoords.len() {
        0 => Ok(()),
        n if n == geometry.positions.len() => Ok(()),
        n => Err(format!("has {n} texture coordinates for {} vertices", geometry.positions.len())),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::{AlphaTest, AlphaTexture, Image, Instance, MeshId};
    use super::*;
    use glam::{DAffine3, DVec3, Vec3};

    fn triangle() -> Scene {
        let geometry = Geometry {
            positions: Arc::from([Vec3::ZERO, Vec3::X, Vec3::Y]),
            triangles: vec![[0, 1, 2]],
            ..Geometry::default()
        };
        Scene {
            meshes: vec![Mesh { geometries: vec![geometry], ..Mesh::default() }].into(),
            instances: vec![Instance {
                name: "one".into(),
                node: 0,
                copy: 0,
                mesh: MeshId(0),
                transform: DAffine3::IDENTITY,
                pinned: None,
            }],
            ..Scene::default()
        }
    }

    fn broken(change: impl FnOnce(&mut Scene)) -> String {
        let mut scene = triangle();
        change(&mut scene);
        scene.check().expect_err("the fault is found").0
    }

    #[test]
    fn a_triangle_is_sound() {
        assert_eq!(triangle().check(), Ok(()));
    }

    #[test]
    fn each_broken_invariant_is_named() {
        assert!(broken(|s| s.meshes[0].geometries.clear()).contains("no geometry"));
        assert!(broken(|s| s.meshes[0].geometries[0].triangles.clear()).contains("is empty"));
        assert!(broken(|s| s.meshes[0].geometries[0].triangles[0][2] = 3).contains("vertex 3 of 3"));
        assert!(
            broken(|s| Arc::make_mut(&mut s.meshes[0].geometries[0].positions)[1].x = f32::NAN).contains("not finite")
        );
        assert!(broken(|s| s.meshes[0].geometries[0].first_triangle = 1).contains("start at triangle 0"));
        assert!(broken(|s| s.meshes[0].geometries[0].material = Some(0)).contains("material"));
        assert!(broken(|s| s.meshes[0].geometries[0].kept = Some(vec![])).contains("source"));
        let alpha = |image, texcoords| {
            let texture = AlphaTexture { image, texcoords, ..AlphaTexture::default() };
            Some(AlphaTest { texture: Some(texture), ..AlphaTest::default() })
        };
        assert!(broken(|s| s.meshes[0].geometries[0].alpha = alpha(0, vec![])).contains("image"));
        let too_few = broken(|s| {
            s.images = vec![Image::broken(String::new(), String::new())];
            s.meshes[0].geometries[0].alpha = alpha(0, vec![[0.0; 2]]);
        });
        assert!(too_few.contains("1 texture coordinates for 3 vertices"), "{too_few}");
        assert!(broken(|s| s.instances[0].mesh = MeshId(1)).contains("mesh that is not there"));
        assert!(broken(|s| s.instances[0].transform.translation = DVec3::INFINITY).contains("not finite"));
    }
}
