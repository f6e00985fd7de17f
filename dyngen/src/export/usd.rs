//! An arm as a stage of USD with UsdPhysics, and with the friction and armature of PhysX, for Isaac Sim.

use super::known::Known;
use super::tree::{Link, Tree};
use super::urdf::Exported;
use crate::arm::{Arm, JointKind};
use crate::import::pose::Pose;
use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use std::fmt::Write;

/// An arm with what is known of it as a stage (.usda): an articulation that stands fixed, masses and
/// inertias, limits, friction and armature.
///
/// Angles are in degrees, as UsdPhysics has them, and so is what is by an angle. `by` says in the second line
/// what wrote the file; `more` are the caller's own notes, which stand in the file too.
///
/// # Errors
/// If the arm has bars of closed loops.
pub fn usd(arm: &Arm, known: &Known, by: &str, more: &[String]) -> Result<Exported, String> {
    let tree = Tree::new(arm, known)?;
    let mut notes = [more, &tree.notes].concat();
    if tree.links.iter().any(|link| link.armature.is_some()) {
        notes.push(
            "a rotor is the armature of its joint: what it does when the link that carries it turns is left \
            out"
            .to_string(),
        );
    }
    for link in tree.links.iter().filter(|link| link.joint.mimic.is_some()) {
        notes.push(format!(
            "joint '{}' follows another one: UsdPhysics has no such joint, it is free here",
            link.name
        ));
    }
    notes.push(
        "friction and armature are attributes of PhysX (PhysxJointAxisAPI): other engines pass them over"
            .to_string(),
    );
    notes.push("the base is fixed: its mass of 1 kg has no effect".to_string());
    let mut stage =
        Stage { text: String::new(), root: identifier(&arm.name, &mut Vec::new()), taken: Vec::new() };
    // Writing to a String cannot fail.
    let _ = stage.write(&tree, by, &notes);
    Ok(Exported { text: stage.text, notes })
}

struct Stage {
    text: String,
    root: String,
    /// Names of prims.
    taken: Vec<String>,
}

impl Stage {
    fn write(&mut self, tree: &Tree<'_>, by: &str, notes: &[String]) -> std::fmt::Result {
        let root = self.root.clone();
        writeln!(self.text, "#usda 1.0\n# {}", line(by))?;
        for note in notes {
            writeln!(self.text, "# {}", line(note))?;
        }
        writeln!(
            self.text,
            "(\n    defaultPrim = \"{root}\"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1"
        )?;
        writeln!(self.text, "    upAxis = \"Z\"\n)\n")?;
        self.scene(tree)?;
        let schemas = "prepend apiSchemas = [\"PhysicsArticulationRootAPI\"]";
        writeln!(self.text, "def Xform \"{root}\" (\n    {schemas}\n)\n{{")?;
        let base = self.body(&tree.root, &Pose::identity(), 1.0, &Vector3::zeros(), &Matrix3::identity())?;
        writeln!(self.text, "    }}\n")?;
        let fixed = identifier("base_on_world", &mut self.taken);
        writeln!(self.text, "    def PhysicsFixedJoint \"{fixed}\"\n    {{")?;
        writeln!(self.text, "        rel physics:body1 = </{root}/{base}>\n    }}\n")?;
        let mut before = base;
        for (i, link) in tree.links.iter().enumerate() {
            let (centre, tensor) = link.body.centre();
            let name = self.body(&link.link, &link.at, link.body.mass, &centre, &tensor)?;
            for frame in tree.fixed.iter().filter(|frame| frame.link == i) {
                let own = identifier(&frame.name, &mut self.taken);
                writeln!(self.text, "\n        def Xform \"{own}\"\n        {{")?;
                self.placed("            ", &frame.pose)?;
                writeln!(self.text, "        }}")?;
            }
            writeln!(self.text, "    }}\n")?;
            self.joint(link, &before, &name)?;
            before = name;
        }
        writeln!(self.text, "}}")
    }

    /// The scene, which has gravity: of no weight where the stage is referenced into another one.
    fn scene(&mut self, tree: &Tree<'_>) -> std::fmt::Result {
        let size = tree.gravity.norm();
        let along = if size > 0.0 { tree.gravity / size } else { -Vector3::z() };
        let direction = list(along.iter().copied());
        writeln!(self.text, "def PhysicsScene \"physics_scene\"\n{{")?;
        writeln!(self.text, "    vector3f physics:gravityDirection = ({direction})")?;
        writeln!(self.text, "    float physics:gravityMagnitude = {size:?}\n}}\n")
    }

    /// A rigid body, whose braces stay open; gives its prim's name.
    fn body(
        &mut self,
        name: &str,
        at: &Pose,
        mass: f64,
        centre: &Vector3<f64>,
        inertia: &Matrix3<f64>,
    ) -> Result<String, std::fmt::Error> {
        let own = identifier(name, &mut self.taken);
        let (moments, axes) = principal(inertia);
        writeln!(self.text, "    def Xform \"{own}\" (")?;
        writeln!(
            self.text,
            "        prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"]\n    )\n    {{"
        )?;
        writeln!(self.text, "        float physics:mass = {mass:?}")?;
        writeln!(self.text, "        point3f physics:centerOfMass = ({})", list(centre.iter().copied()))?;
        writeln!(self.text, "        float3 physics:diagonalInertia = ({})", list(moments.iter().copied()))?;
        writeln!(self.text, "        quatf physics:principalAxes = ({})", quaternion(&axes))?;
        self.placed("        ", at)?;
        Ok(own)
    }

    /// Where a prim stands in the one above it.
    fn placed(&mut self, margin: &str, at: &Pose) -> std::fmt::Result {
        writeln!(self.text, "{margin}quatd xformOp:orient = ({})", quaternion(&at.rotation))?;
        writeln!(self.text, "{margin}double3 xformOp:translate = ({})", list(at.origin.iter().copied()))?;
        writeln!(
            self.text,
            "{margin}uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"]"
        )
    }

    fn joint(&mut self, link: &Link<'_>, before: &str, behind: &str) -> std::fmt::Result {
        // What is an angle is in degrees, what is by an angle in units by degree.
        let (kind, axis, degree) = match link.joint.kind {
            JointKind::Revolute => ("Revolute", "angular", 1f64.to_degrees()),
            JointKind::Prismatic => ("Prismatic", "linear", 1.0),
        };
        let (own, root) = (identifier(&link.name, &mut self.taken), &self.root);
        let text = &mut self.text;
        writeln!(text, "    def Physics{kind}Joint \"{own}\" (")?;
        writeln!(
            text,
            "        prepend apiSchemas = [\"PhysicsDriveAPI:{axis}\", \"PhysxJointAxisAPI:{axis}\"]\n    \
            )\n    {{"
        )?;
        writeln!(text, "        uniform token physics:axis = \"Z\"")?;
        writeln!(text, "        rel physics:body0 = </{root}/{before}>")?;
        writeln!(text, "        rel physics:body1 = </{root}/{behind}>")?;
        writeln!(text, "        point3f physics:localPos0 = ({})", list(link.pose.origin.iter().copied()))?;
        writeln!(text, "        quatf physics:localRot0 = ({})", quaternion(&link.pose.rotation))?;
        writeln!(text, "        point3f physics:localPos1 = (0, 0, 0)")?;
        writeln!(text, "        quatf physics:localRot1 = (1, 0, 0, 0)")?;
        let mut number = |name: &str, value: Option<f64>| match value {
            Some(value) => writeln!(text, "        float {name} = {value:?}"),
            None => Ok(()),
        };
        let [lower, upper] = link.joint.position.map_or([None; 2], |limits| limits.map(|x| Some(degree * x)));
        number("physics:lowerLimit", lower)?;
        number("physics:upperLimit", upper)?;
        // The drive only limits the torque: damping is in the friction.
        number(&format!("drive:{axis}:physics:stiffness"), Some(0.0))?;
        number(&format!("drive:{axis}:physics:damping"), Some(0.0))?;
        number(&format!("drive:{axis}:physics:maxForce"), link.joint.torque)?;
        let own = format!("physxJointAxis:{axis}");
        number(&format!("{own}:maxJointVelocity"), link.joint.velocity.map(|v| degree * v))?;
        number(&format!("{own}:armature"), link.armature)?;
        let coulomb = link.friction.map(|friction| friction.coulomb);
        number(&format!("{own}:staticFrictionEffort"), coulomb)?;
        number(&format!("{own}:dynamicFrictionEffort"), coulomb)?;
        let viscous = link.friction.and_then(|friction| friction.viscous);
        number(&format!("{own}:viscousFrictionCoefficient"), viscous.map(|viscous| viscous / degree))?;
        writeln!(self.text, "    }}\n")
    }
}

/// Principal moments of inertia, and their axes as the columns of a rotation.
fn principal(inertia: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let SymmetricEigen { eigenvectors: mut axes, eigenvalues } = inertia.symmetric_eigen();
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    (eigenvalues, axes)
}

/// A rotation as w, x, y, z.
fn quaternion(rotation: &Matrix3<f64>) -> String {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    list([q.w, q.i, q.j, q.k].into_iter())
}

fn list(numbers: impl Iterator<Item = f64>) -> String {
    // No −0.
    numbers.map(|x| format!("{:?}", x + 0.0)).collect::<Vec<_>>().join(", ")
}

/// A text in one line.
fn line(text: &str) -> String {
    text.replace(|c: char| c.is_control(), " ")
}

/// A name for a prim that no other one has: letters, digits and `_`.
fn identifier(name: &str, taken: &mut Vec<String>) -> String {
    let mut own = name.replace(|c: char| !c.is_ascii_alphanumeric() && c != '_', "_");
    if !own.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        own.insert(0, '_');
    }
    while taken.contains(&own) {
        own.push('_');
    }
    taken.push(own.clone());
    own
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::{arm, known};
    use super::*;

    /// The numbers behind each of these attributes.
    fn values(text: &str, attribute: &str) -> Vec<Vec<f64>> {
        let lines = text.lines().filter_map(|line| line.trim().split_once(&format!(" {attribute} = ")));
        let numbers = |(_, list): (&str, &str)| {
            let list = list.trim_matches(['(', ')']);
            list.split(", ").map(|number| number.parse().unwrap()).collect()
        };
        lines.map(numbers).collect()
    }

    /// Principal moments along the axes give the tensor back, and what is by an angle is by degree.
    #[test]
    fn what_is_known_stands_in_the_stage() {
        let arm = arm("modified");
        let known = known(&arm);
        let exported = usd(&arm, &known, "written by\na test", &[]).unwrap();
        let text = &exported.text;
        assert!(text.starts_with("#usda 1.0\n# written by a test\n"));
        let tree = Tree::new(&arm, &known).unwrap();
        for (i, link) in tree.links.iter().enumerate() {
            let (centre, tensor) = link.body.centre();
            // The base is the first body.
            let of = |attribute: &str| values(text, attribute)[i + 1].clone();
            assert_eq!(of("physics:mass"), [link.body.mass]);
            assert_eq!(of("physics:centerOfMass"), centre.as_slice());
            let [w, x, y, z] = of("physics:principalAxes")[..] else { panic!("{text}") };
            let turned =
                UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z)).to_rotation_matrix();
            let moments = Matrix3::from_diagonal(&Vector3::from_column_slice(&of("physics:diagonalInertia")));
            let back = turned * moments * turned.inverse();
            assert!((back - tensor).norm() < 1e-12, "{back} {tensor}");
        }
        let degree = 180.0 / std::f64::consts::PI;
        let near = |attribute: &str, expected: &[f64]| {
            let found = values(text, attribute).concat();
            assert_eq!(found.len(), expected.len(), "{attribute}");
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-12 * b.abs()), "{found:?}");
        };
        near("physics:lowerLimit", &[-2.5 * degree, 0.0]);
        near("physxJointAxis:angular:viscousFrictionCoefficient", &[0.5 / degree, 2.5 / degree]);
        near("physxJointAxis:linear:viscousFrictionCoefficient", &[1.5]);
        near("physxJointAxis:angular:armature", &[0.3]);
        near("physxJointAxis:angular:staticFrictionEffort", &[1.5, 1.0]);
    }

    #[test]
    fn prims_have_names_of_their_own() {
        let mut taken = Vec::new();
        let names = ["arm-1.a", "arm_1_a", "7", "ä"].map(|name| identifier(name, &mut taken));
        assert_eq!(names, ["arm_1_a", "arm_1_a_", "_7", "_"]);
    }
}
