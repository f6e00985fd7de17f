//! The mass of a link and its rotor, as the eleven parameters of Eq. 10 order them.

use nalgebra::{Matrix3, Vector3};

/// Parameters of one link.
pub const PER_LINK: usize = 11;

/// A link's inertia in its frame and about the frame's origin, and the rotor that drives its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass, kg.
    pub mass: f64,
    /// First moment: mass times the centre of mass in the link's frame, kg·m.
    pub moment: Vector3<f64>,
    /// Inertia tensor about the frame's origin, kg·m²; its off-diagonal elements are −Ixy, −Ixz, −Iyz.
    pub inertia: Matrix3<f64>,
    /// Inertia of the rotor that drives this link's joint, on the motor's side, kg·m².
    pub rotor: f64,
}

impl Body {
    /// From `m mx my mz Ixx Ixy Ixz Iyy Iyz Izz Im`.
    pub fn from_parameters(p: &[f64; PER_LINK]) -> Self {
        let [mass, mx, my, mz, xx, xy, xz, yy, yz, zz, rotor] = *p;
        Body {
            mass,
            moment: Vector3::new(mx, my, mz),
            inertia: Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz),
            rotor,
        }
    }

    /// A body from its mass in kg, its centre of mass in the link's frame in m, and its tensor about the
    /// centre of mass in kg·m².
    pub fn about_centre(mass: f64, centre: Vector3<f64>, tensor: Matrix3<f64>, rotor: f64) -> Self {
        // Steiner: I = Ic + m (c·c E − c cᵀ).
        let shift = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
        Body { mass, moment: mass * centre, inertia: tensor + mass * shift, rotor }
    }

    /// A box of even density with edges along the frame's axes: mass in kg, centre and edges in m.
    pub fn even_box(mass: f64, centre: [f64; 3], edges: [f64; 3], rotor: f64) -> Self {
        let [x, y, z] = edges.map(|e| e * e * mass / 12.0);
        let tensor = Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y));
        Body::about_centre(mass, Vector3::from(centre), tensor, rotor)
    }

    /// The same body moved by `by`, m, without turning it.
    #[must_use]
    pub fn moved(&self, by: Vector3<f64>) -> Self {
        let centre = self.moment / self.mass;
        let shift = Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
        Body::about_centre(self.mass, centre + by, self.inertia - self.mass * shift, self.rotor)
    }

    /// The eleven parameters in order.
    pub fn parameters(&self) -> [f64; PER_LINK] {
        let (h, i) = (&self.moment, &self.inertia);
        [
            self.mass,
            h.x,
            h.y,
            h.z,
            i[(0, 0)],
            -i[(0, 1)],
            -i[(0, 2)],
            i[(1, 1)],
            -i[(1, 2)],
            i[(2, 2)],
            self.rotor,
        ]
    }
}

/// The bodies of a vector of parameters, eleven a link; `None` where its length is no multiple of eleven.
pub fn bodies(parameters: &[f64]) -> Option<Vec<Body>> {
    let (links, rest) = parameters.as_chunks::<PER_LINK>();
    rest.is_empty().then(|| links.iter().map(Body::from_parameters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_round_trip() {
        let body = Body::even_box(2.0, [0.1, -0.2, 0.3], [0.05, 0.1, 0.2], 3e-5);
        assert_eq!(Body::from_parameters(&body.parameters()), body);
        // The product of inertia of a point mass is m·x·y, with its own sign.
        let point = Body::even_box(2.0, [0.1, 0.2, 0.0], [0.0; 3], 0.0).parameters();
        approx::assert_relative_eq!(point[5], 0.04, max_relative = 1e-14);
        let there_and_back = body.moved(Vector3::new(0.1, 0.2, 0.3)).moved(Vector3::new(-0.1, -0.2, -0.3));
        approx::assert_relative_eq!(
            there_and_back.inertia,
            body.inertia,
            max_relative = 1e-13,
            epsilon = 1e-15
        );
        assert!(bodies(&[0.0; 12]).is_none());
    }
}
