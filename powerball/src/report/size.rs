//! The size of an effect in words: each figure with its unit and, where the fit gives one, its standard error.

use super::number;
use crate::controller::JointNumber;
use crate::explanation::effects::{
    ByJoint, Figures, asymmetry, contact_wrench, joint_coupling, payload, position_ripple,
};
use crate::explanation::explain::NamedEffect;

/// Of so many pushes each is shown; of more the range.
const EACH: usize = 3;

/// The size of an effect; `sliding` says of each joint whether it slides, so that its torques are forces.
#[must_use]
pub fn size(effect: &NamedEffect, sliding: &[bool]) -> String {
    let slides =
        effect.joints.first().is_some_and(|joint| sliding.get(joint.index()).copied().unwrap_or(false));
    let [torque, position] = if slides { ["N", "m"] } else { ["N·m", "rad"] };
    let std = |k: usize| effect.relative_std.get(k).copied().flatten();
    let sure = |ByJoint(values): &ByJoint, factor: f64| -> Vec<String> {
        values.iter().enumerate().map(|(k, value)| with_error(factor * value, std(k))).collect()
    };
    let known = |ByJoint(values): &ByJoint, factor: f64| -> Vec<String> {
        values.iter().map(|value| number(factor * value)).collect()
    };
    match &effect.figures {
        Figures::LoadFriction(f) => format!("{} {torque} per {torque}", sure(&f.coefficient, 1.0).join(", ")),
        Figures::Stribeck(f) => format!(
            "{} {torque} more at rest, gone beyond {} {position}/s",
            sure(&f.level, 1.0).join(", "),
            known(&f.velocity, 1.0).join(", ")
        ),
        Figures::VelocityNonlinearity(f) => {
            let one = |(k, (c, power)): (usize, (&f64, &f64))| {
                format!("{} {torque}·|dq|^{} (dq in {position}/s)", with_error(*c, std(k)), number(*power))
            };
            f.coefficient.iter().zip(&f.power).enumerate().map(one).collect::<Vec<_>>().join(", ")
        }
        Figures::Asymmetry(f) => asymmetric(f, &effect.relative_std, torque, position),
        Figures::TorqueConstant(f) => {
            let one = |k: usize| {
                let (gain, change) = (f.gain.0[k] - 1.0, f.change_at_torque.0[k]);
                match change == 0.0 {
                    true => format!("{} %", with_error(100.0 * gain, std(k))),
                    false => {
                        format!(
                            "{} % at {} {torque}",
                            with_error(100.0 * change, std(k)),
                            number(f.torque.0[k])
                        )
                    }
                }
            };
            (0..f.gain.0.len()).map(one).collect::<Vec<_>>().join(", ")
        }
        Figures::PositionRipple(f) => ripples(f, &std, torque, slides),
        Figures::Spring(f) => format!(
            "{} {torque}/{position}, at rest at {} {position}",
            sure(&f.stiffness, 1.0).join(", "),
            known(&f.rest, 1.0).join(", ")
        ),
        Figures::Hysteresis(f) => format!(
            "{} {torque} within {} {position} of a reversal",
            sure(&f.level, 1.0).join(", "),
            known(&f.distance, 1.0).join(", ")
        ),
        Figures::JointElasticity(f) => format!("{} {torque}/{position}", sure(&f.stiffness, 1.0).join(", ")),
        Figures::Backlash(f) => format!("{} {position}", known(&f.gap, 1.0).join(", ")),
        Figures::TimeDelay(f) => format!("{} ms", sure(&f.delay, 1e3).join(", ")),
        Figures::EncoderOffset(f) => format!("{} {position}", sure(&f.offset, 1.0).join(", ")),
        Figures::Temperature(f) => {
            let one = |(k, (change, time)): (usize, (&f64, &f64))| {
                let change = with_error(100.0 * change, std(k));
                match *time > 0.0 {
                    true => format!("{change} % of the friction when cold, within {} s", number(*time)),
                    false => format!("{change} % for 10 K"),
                }
            };
            f.change.0.iter().zip(&f.time_constant.0).enumerate().map(one).collect::<Vec<_>>().join(", ")
        }
        Figures::Payload(f) => body(f),
        Figures::ContactWrench(f) => pushes(f),
        Figures::BaseTilt(f) => {
            format!("{} rad about x, {} rad about y", number(f.tilt[0]), number(f.tilt[1]))
        }
        Figures::BrokenSymmetry(f) => {
            let one = |(k, (name, value)): (usize, (&String, &f64))| {
                format!("{name} = {}", with_error(*value, std(k)))
            };
            format!(
                "{} (SI units)",
                f.parameters.iter().zip(&f.values).enumerate().map(one).collect::<Vec<_>>().join(", ")
            )
        }
        Figures::JointCoupling(f) => couplings(f),
        Figures::UnnamedLaw(f) => f.formulas.iter().map(|f| f.formula.clone()).collect::<Vec<_>>().join("; "),
    }
}

/// A value to the digits that are known of it: `0.061 ± 0.002`; without a standard error three digits.
#[must_use]
pub fn with_error(value: f64, relative_std: Option<f64>) -> String {
    let std = relative_std.map_or(f64::NAN, |share| (share * value).abs());
    if !(std.is_finite() && std > 0.0 && (1e-6..1e6).contains(&std)) {
        return number(value);
    }
    // One digit of the error; two where that digit is 1.
    let first = std.log10().floor();
    let digit = (std / 10f64.powf(first)).round();
    let decimals = (if digit <= 1.0 { 1.0 - first } else { -first }).max(0.0) as usize;
    let text = format!("{value:.decimals$} ± {std:.decimals$}");
    text.replace('-', "\u{2212}")
}

/// A joint's two parts may be one effect or two: the standard error is that of a part which stands alone.
fn asymmetric(f: &asymmetry::Figures, std: &[Option<f64>], torque: &str, position: &str) -> String {
    let one = |(k, (constant, viscous)): (usize, (&f64, &f64))| {
        let alone = std.len() == f.torque.len() && (*constant == 0.0 || *viscous == 0.0);
        let std = std.get(k).copied().flatten().filter(|_| alone);
        let constant_in_words = || format!("{} {torque} constant", with_error(*constant, std));
        let viscous_in_words = || format!("{} {torque}·s/{position} of |dq|", with_error(*viscous, std));
        match (*constant != 0.0, *viscous != 0.0) {
            (true, true) => format!("{} and {}", constant_in_words(), viscous_in_words()),
            (false, true) => viscous_in_words(),
            _ => constant_in_words(),
        }
    };
    f.torque.iter().zip(&f.viscous).enumerate().map(one).collect::<Vec<_>>().join(", ")
}

fn ripples(
    f: &position_ripple::Figures,
    std: &dyn Fn(usize) -> Option<f64>,
    torque: &str,
    slides: bool,
) -> String {
    // Of a joint that slides the order counts on 2π m.
    let (way, orders) = if slides { ("m", 1.0 / std::f64::consts::TAU) } else { ("turn", 1.0) };
    let several = f.joints.iter().any(|joint| *joint != f.joints[0]);
    let one = |(k, ((amplitude, joint), order)): (usize, ((&f64, &JointNumber), &f64))| {
        let of = if several { format!(" (joint {joint})") } else { String::new() };
        format!("{} {torque}, {} cycles a {way}{of}", with_error(*amplitude, std(k)), number(orders * order))
    };
    f.amplitudes.iter().zip(&f.joints).zip(&f.orders).enumerate().map(one).collect::<Vec<_>>().join("; ")
}

fn body(f: &payload::Figures) -> String {
    let vector = |x: &[f64; 3]| format!("({})", x.map(number).join(", "));
    let what = match (f.mass, &f.com, &f.first_moment) {
        (Some(mass), Some(com), _) => format!("{} kg at {} m", number(mass), vector(com)),
        (Some(mass), None, _) => format!("{} kg", number(mass)),
        (None, _, Some(moment)) => format!("first moment {} kg·m", vector(moment)),
        (None, ..) => "a body".to_string(),
    };
    let link = f.link.map_or_else(|| "the last link".to_string(), |link| format!("link {link}"));
    let times: Vec<String> = (f.start_time.iter().enumerate())
        .map(|(k, from)| match f.end_time.get(k).copied().flatten() {
            Some(to) => format!("{} to {} s", number(*from), number(to)),
            None => format!("from {} s on", number(*from)),
        })
        .collect();
    let when = if times.is_empty() { String::new() } else { format!(", {}", times.join(", ")) };
    format!("{what} of {link}{when}")
}

fn pushes(f: &contact_wrench::Figures) -> String {
    let size = |force: &Vec<f64>| force.iter().map(|x| x * x).sum::<f64>().sqrt();
    let sizes: Vec<f64> = f.force.iter().map(size).collect();
    let times = f.start_time.iter().zip(&f.end_time);
    if sizes.len() <= EACH {
        let one = |(size, (from, to)): (&f64, (&f64, &f64))| {
            format!("{} N from {from:.1} to {to:.1} s", number(*size))
        };
        return sizes.iter().zip(times).map(one).collect::<Vec<_>>().join(", ");
    }
    let [least, most] = [f64::min, f64::max].map(|of| sizes.iter().copied().reduce(of).unwrap_or(f64::NAN));
    let seconds: f64 = times.map(|(from, to)| to - from).sum();
    format!("{} pushes of {} to {} N, {seconds:.1} s together", sizes.len(), number(least), number(most))
}

fn couplings(f: &joint_coupling::Figures) -> String {
    let one =
        |((law, from), c): ((&&str, &JointNumber), &f64)| format!("{law} of joint {from}: {}", number(*c));
    let list: Vec<String> = f.law.iter().zip(&f.from_joint).zip(&f.coefficient).map(one).collect();
    format!("{} (SI units)", list.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_digits_that_its_error_leaves() {
        for (value, relative_std, text) in [
            (0.061_23, Some(0.033), "0.061 ± 0.002"),
            (14_870.0, Some(0.02), "14870 ± 297"),
            (1.234_56, Some(0.01), "1.235 ± 0.012"),
            (-0.5, Some(0.6), "−0.5 ± 0.3"),
            (0.000_479_999_999_999_999_96, None, "0.000480"),
            (3.0, Some(f64::NAN), "3.00"),
        ] {
            assert_eq!(with_error(value, relative_std), text);
        }
    }
}
