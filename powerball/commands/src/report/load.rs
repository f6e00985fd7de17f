//! A load at the flange in the words of robots' controllers.
//!
//! What a form cannot hold is in [`Exported::notes`]: nothing is left out without a note. Forms with comments
//! have the notes in them too.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen};
use serde::Deserialize;

/// A body on the last link.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// Mass, kg.
    pub mass: f64,
    /// The mass's standard error, kg, where it is known.
    pub mass_std: Option<f64>,
    /// Centre of mass in the last link's frame, m.
    pub centre: [f64; 3],
    /// Inertia about the centre of mass along the axes of that frame, kg·m²; `None` where it was not
    /// determined.
    pub inertia: Option<Matrix3<f64>>,
}

/// Whose controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "offline", derive(clap::ValueEnum))]
pub enum Form {
    /// Franka: endeffector-config.json of an end effector.
    Franka,
    /// Universal Robots: set_target_payload of URScript.
    Ur,
    /// KUKA: LOAD_DATA in KRL.
    Kuka,
    /// Kinova: ToolConfiguration of Kortex as JSON.
    Kinova,
    /// Doosan: the request of config_create_tool as YAML.
    Doosan,
    /// UFACTORY: set_tcp_load of the xArm Python SDK.
    Xarm,
}

/// A load in a form.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The text of the file.
    pub text: String,
    /// What the form cannot hold, and what to look at before it is used.
    pub notes: Vec<String>,
}

/// What of explained.json and comparison.json says that there is a load.
#[derive(Deserialize)]
#[serde(untagged)]
enum Result {
    Explained { effects: Vec<Named> },
    Compared { causes: Vec<Cause> },
}

#[derive(Deserialize)]
struct Named {
    effect: String,
    parameters: serde_json::Value,
    relative_std: Vec<Option<f64>>,
}

#[derive(Deserialize)]
struct Payload {
    mass: Option<f64>,
    com_in_link: Option<[f64; 3]>,
    link: Option<usize>,
    bar: Option<String>,
}

#[derive(Deserialize)]
struct Cause {
    cause: String,
    body: Option<Body>,
}

/// A body by which two fits differ.
#[derive(Deserialize)]
struct Body {
    mass: f64,
    mass_std: f64,
    com: [f64; 3],
    inertia: Option<[f64; 6]>,
}

impl Load {
    /// The load of a result: explained.json with a payload on the last link, or comparison.json whose cause
    /// is one.
    ///
    /// # Errors
    /// Why there is none.
    pub fn of_result(text: &str) -> std::result::Result<Load, String> {
        let result: Result = serde_json::from_str(text).map_err(|_| NO_RESULT.to_string())?;
        match result {
            Result::Explained { effects } => {
                let named = effects.into_iter().find(|effect| effect.effect == "payload");
                let named = named.ok_or("no payload was found in these logs: there is no load to export")?;
                let payload: Payload =
                    serde_json::from_value(named.parameters).map_err(|e| format!("payload: {e}"))?;
                if let Some(link) = payload.link {
                    let carrier = payload.bar.map_or(format!("link {link}"), |bar| format!("bar {bar}"));
                    return Err(format!(
                        "the body that was found is on {carrier} and not at the flange: a controller takes \
                         loads at the flange alone"
                    ));
                }
                let (Some(mass), Some(centre)) = (payload.mass, payload.com_in_link) else {
                    return Err("the payload's mass or centre was not determined by these logs".to_string());
                };
                let relative = named.relative_std.first().copied().flatten();
                Ok(Load { mass, mass_std: relative.map(|std| std * mass.abs()), centre, inertia: None })
            }
            Result::Compared { causes } => {
                let body = causes.into_iter().find(|cause| cause.cause == "payload").map(|cause| cause.body);
                let body = body.ok_or("the two results do not differ by a load")?;
                let body = body.ok_or(
                    "the two results differ by a body whose mass or centre they do not determine, or which \
                     is not on the last link; a `zero` of the last link in the arm file leaves a part of the \
                     centre out: take it out of the file and identify again",
                )?;
                let Body { mass, mass_std, com, inertia } = body;
                let tensor =
                    |[xx, xy, xz, yy, yz, zz]: [f64; 6]| Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let inertia = inertia.map(tensor).filter(is_of_a_body);
                Ok(Load { mass, mass_std: Some(mass_std), centre: com, inertia })
            }
        }
    }

    /// The load in a form.
    ///
    /// # Errors
    /// A load that no controller can take: less than nothing.
    pub fn export(&self, form: Form) -> std::result::Result<Exported, String> {
        if self.mass <= 0.0 {
            return Err(format!(
                "the load is {:.3} kg: the arm carries less than before; exchange the two results",
                self.mass
            ));
        }
        let mut notes = vec![
            "the centre of mass is in the frame of the last link: where the controller's flange has another \
             frame, turn and move it"
                .to_string(),
        ];
        match self.mass_std {
            Some(std) => notes.push(format!("mass {:.3} kg ± {std:.3} kg (standard error)", self.mass)),
            None => notes.push("the standard error of the mass is not known".to_string()),
        }
        if self.inertia.is_none() {
            notes.push(
                "the inertia about the centre of mass was not determined, or is one that no body has: it is \
                given as 0"
                    .to_string(),
            );
        } else if !form.has_inertia() {
            notes.push("the form has no inertia: it is left out".to_string());
        }
        let text = match form {
            Form::Franka => self.franka(),
            Form::Ur => self.ur(),
            Form::Kuka => self.kuka(),
            Form::Kinova => self.kinova(),
            Form::Doosan => self.doosan(),
            Form::Xarm => self.xarm(),
        };
        let comments = form.comment().map(|sign| {
            let lines =
                std::iter::once("written by powerball export").chain(notes.iter().map(String::as_str));
            lines.map(|line| format!("{sign} {line}\n")).collect::<String>()
        });
        Ok(Exported { text: comments.unwrap_or_default() + &text, notes })
    }

    /// Inertia about the centre; 0 where it is not known.
    fn tensor(&self) -> Matrix3<f64> {
        self.inertia.unwrap_or_else(Matrix3::zeros)
    }

    /// The centre of mass in millimetres.
    fn millimetres(&self) -> [String; 3] {
        self.centre.map(|x| format!("{:.2}", 1e3 * x))
    }

    /// Franka RIDE, *End effector commissioning*: metres, kg·m², matrices by columns.
    fn franka(&self) -> String {
        let identity: Vec<f64> = nalgebra::Matrix4::identity().iter().copied().collect();
        let inertia: Vec<f64> = self.tensor().iter().map(|value| rounded(*value)).collect();
        let json = serde_json::json!({
            "id": "powerball-load",
            "name": "powerball load",
            "mass": rounded(self.mass),
            "centerOfMass": self.centre.map(rounded),
            "transformation": identity,
            "inertia": inertia,
        });
        format!("{json:#}\n")
    }

    /// URScript, `set_target_payload(m, cog, inertia)`: metres, kg·m² in the order xx, yy, zz, xy, xz, yz.
    fn ur(&self) -> String {
        let i = self.tensor();
        let inertia = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
        let list = |values: &[f64]| {
            values.iter().map(|value| rounded(*value).to_string()).collect::<Vec<_>>().join(", ")
        };
        format!(
            "set_target_payload({}, [{}], [{}])\n",
            rounded(self.mass),
            list(&self.centre),
            list(&inertia)
        )
    }

    /// KRL: millimetres and degrees; inertias about the principal axes, which are turned by A about z, then
    /// by B about the new y, then by C about the new x.
    fn kuka(&self) -> String {
        let SymmetricEigen { eigenvalues, mut eigenvectors } = SymmetricEigen::new(self.tensor());
        if eigenvectors.determinant() < 0.0 {
            eigenvectors.column_mut(2).neg_mut();
        }
        let (c, b, a) = Rotation3::from_matrix_unchecked(eigenvectors).euler_angles();
        let [x, y, z] = self.millimetres();
        let [a, b, c] = [a, b, c].map(|angle| format!("{:.3}", angle.to_degrees()));
        let [jx, jy, jz] = [0, 1, 2].map(|k| format!("{:.6}", eigenvalues[k]));
        format!(
            "LOAD_DATA[1]={{M {:.3},CM {{X {x},Y {y},Z {z},A {a},B {b},C {c}}},J {{X {jx},Y {jy},Z \
            {jz}}}}}\n",
            self.mass
        )
    }

    /// Kortex, `ControlConfig.ToolConfiguration`: metres; the tool's frame is the flange's.
    fn kinova(&self) -> String {
        let [x, y, z] = self.centre.map(rounded);
        let json = serde_json::json!({
            "toolTransform": {"x": 0.0, "y": 0.0, "z": 0.0, "thetaX": 0.0, "thetaY": 0.0, "thetaZ": 0.0},
            "toolMass": rounded(self.mass),
            "toolMassCenter": {"x": x, "y": y, "z": z},
        });
        format!("{json:#}\n")
    }

    /// `dsr_msgs/srv/ConfigCreateTool`: millimetres; kg·m² in the order xx, yy, zz, xy, yz, xz.
    fn doosan(&self) -> String {
        let i = self.tensor();
        let inertia = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(1, 2)], i[(0, 2)]];
        let inertia = inertia.map(|value| rounded(value).to_string()).join(", ");
        let centre = self.millimetres().join(", ");
        format!(
            "name: powerball_load\nweight: {}\ncog: [{centre}]\ninertia: [{inertia}]\n",
            rounded(self.mass)
        )
    }

    /// xArm Python SDK, `set_tcp_load(weight, center_of_gravity)`: millimetres.
    fn xarm(&self) -> String {
        format!("arm.set_tcp_load({}, [{}])\n", rounded(self.mass), self.millimetres().join(", "))
    }
}

impl Form {
    /// Whether the form has a place for the inertia.
    fn has_inertia(self) -> bool {
        !matches!(self, Form::Kinova | Form::Xarm)
    }

    /// What a comment begins with; `None` in JSON.
    fn comment(self) -> Option<&'static str> {
        match self {
            Form::Franka | Form::Kinova => None,
            Form::Kuka => Some(";"),
            Form::Ur | Form::Doosan | Form::Xarm => Some("#"),
        }
    }
}

/// A file that is neither result.
const NO_RESULT: &str = "neither explained.json of `powerball explain` nor comparison.json of `powerball \
    compare`; identified.json is a whole arm and no load: compare it with the fit of the arm without the \
    load";

/// Whether a body can have a tensor of inertia: no principal moment is more than the other two together.
fn is_of_a_body(tensor: &Matrix3<f64>) -> bool {
    let moments = tensor.symmetric_eigenvalues();
    moments.iter().all(|moment| 2.0 * moment <= moments.sum())
}

/// To a millionth of a unit: a thousandth of a millimetre, a milligram.
fn rounded(value: f64) -> f64 {
    // No −0.
    (1e6 * value).round() / 1e6 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn load() -> Load {
        // A box whose axes are turned; the tensor is symmetric and positive.
        let turned = Rotation3::from_euler_angles(0.3, -0.7, 1.1);
        let inertia = turned * Matrix3::from_diagonal(&[0.01, 0.02, 0.025].into()) * turned.inverse();
        Load { mass: 2.5, mass_std: Some(0.02), centre: [0.012, -0.034, 0.056], inertia: Some(inertia) }
    }

    fn text(form: Form) -> String {
        load().export(form).unwrap().text
    }

    /// The numbers of a text, in order.
    fn numbers(text: &str) -> Vec<f64> {
        let ends = |c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-'));
        let last = text.lines().last().unwrap();
        last.split(ends).filter_map(|word| word.parse().ok()).collect()
    }

    /// KUKA's angles turn the principal axes: A about z, B about the new y, C about the new x.
    #[test]
    fn principal_axes_and_moments_give_the_tensor_back() {
        let text = text(Form::Kuka);
        let all = numbers(text.split_once('=').unwrap().1);
        let [m, x, y, z, a, b, c, jx, jy, jz] = all[..] else { panic!("{text}") };
        assert_relative_eq!(m, 2.5);
        assert_eq!([x, y, z], [12.0, -34.0, 56.0]);
        let about = |axis, angle: f64| Rotation3::from_axis_angle(&axis, angle.to_radians());
        let turned = about(nalgebra::Vector3::z_axis(), a)
            * about(nalgebra::Vector3::y_axis(), b)
            * about(nalgebra::Vector3::x_axis(), c);
        let tensor = turned * Matrix3::from_diagonal(&[jx, jy, jz].into()) * turned.inverse();
        assert_relative_eq!(tensor, load().inertia.unwrap(), epsilon = 2e-6);
    }

    #[test]
    fn each_form_has_its_units_and_its_order() {
        let i = load().inertia.unwrap();
        let [xx, yy, zz] = [i[(0, 0)], i[(1, 1)], i[(2, 2)]].map(rounded);
        let [xy, xz, yz] = [i[(0, 1)], i[(0, 2)], i[(1, 2)]].map(rounded);
        assert_eq!(numbers(&text(Form::Ur)), [2.5, 0.012, -0.034, 0.056, xx, yy, zz, xy, xz, yz]);
        assert_eq!(numbers(&text(Form::Doosan)), [xx, yy, zz, xy, yz, xz]);
        assert!(text(Form::Doosan).contains("cog: [12.00, -34.00, 56.00]"));
        assert_eq!(numbers(&text(Form::Xarm)), [2.5, 12.0, -34.0, 56.0]);
        let json = |form| serde_json::from_str::<serde_json::Value>(&text(form)).unwrap();
        let franka = json(Form::Franka);
        assert_eq!(franka["centerOfMass"], serde_json::json!([0.012, -0.034, 0.056]));
        assert_eq!(franka["inertia"], serde_json::json!([xx, xy, xz, xy, yy, yz, xz, yz, zz]));
        assert_eq!(json(Form::Kinova)["toolMassCenter"]["y"], -0.034);
        let left_out = |form| load().export(form).unwrap().notes.iter().any(|note| note.contains("left out"));
        assert!(left_out(Form::Kinova) && left_out(Form::Xarm) && !left_out(Form::Ur));
    }

    #[test]
    fn a_load_is_read_from_a_result_or_refused_with_the_reason() {
        let explained = |parameters: &str| {
            format!(
                r#"{{"effects": [{{"effect": "payload", "parameters": {parameters}, "relative_std": [0.1]}}]}}"#
            )
        };
        let found = Load::of_result(&explained(r#"{"mass": 2, "com": [9, 9, 9], "com_in_link": [1, 2, 3]}"#));
        let expected = Load { mass: 2.0, mass_std: Some(0.2), centre: [1.0, 2.0, 3.0], inertia: None };
        assert_eq!(found.unwrap(), expected);
        let body = |inertia: &str| {
            format!(r#"{{"mass": 1, "mass_std": 0.1, "com": [0, 0, 1], "inertia": [{inertia}]}}"#)
        };
        let compared = |body: &str| format!(r#"{{"causes": [{{"cause": "payload", "body": {body}}}]}}"#);
        let tensor = |inertia| Load::of_result(&compared(&body(inertia))).unwrap().inertia;
        let possible = Matrix3::new(4.0, 0.1, 0.2, 0.1, 5.0, 0.3, 0.2, 0.3, 6.0);
        assert_eq!(tensor("4, 0.1, 0.2, 5, 0.3, 6"), Some(possible));
        assert_eq!((tensor("1, 0, 0, 1, 0, 3"), tensor("1, 0, 0, 1, 0, -1")), (None, None));
        for (text, reason) in [
            (explained(r#"{"link": 2, "first_moment": [1, 0, 0]}"#), "on link 2"),
            (explained(r#"{"link": 5, "bar": "rod", "first_moment": [1, 0, 0]}"#), "on bar rod"),
            (explained(r#"{"mass": 2}"#), "not determined"),
            (r#"{"effects": []}"#.to_string(), "no payload"),
            (r#"{"causes": []}"#.to_string(), "do not differ by a load"),
            (compared("null"), "do not determine"),
            (r#"{"parameters": []}"#.to_string(), "identified.json is a whole arm"),
            ("mass".to_string(), "neither explained.json"),
        ] {
            let why = Load::of_result(&text).unwrap_err();
            assert!(why.contains(reason), "{why}");
        }
        let lighter = Load { mass: -1.0, ..load() }.export(Form::Ur).unwrap_err();
        assert!(lighter.contains("exchange the two results"), "{lighter}");
    }
}
