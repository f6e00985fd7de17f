//! What MuJoCo holds by equalities: a joint that follows another one, or what an arm file cannot hold.

use super::mjcf::WORLD;
use super::numbers::finite;
use roxmltree::Node;

/// An equality of a model.
pub(super) enum Equality {
    /// The first joint's position beyond its reference is offset + ratio times the second's beyond its own.
    Follows { joint: String, leader: String, offset: f64, ratio: f64 },
    /// A joint stands at an offset from its reference.
    Stands { joint: String, offset: f64 },
    /// Two bodies, or the bodies of two sites, have a point in common; where no site is named it is given in
    /// the first.
    Connects { bodies: [String; 2], sites: Option<[String; 2]>, anchor: [f64; 3] },
    /// Why it is left out.
    LeftOut(&'static str),
}

/// Reads one; none where it is not active.
///
/// # Errors
/// What is wrong with its numbers.
pub(super) fn read(node: Node<'_, '_>) -> Result<Option<Equality>, String> {
    if node.attribute("active") == Some("false") {
        return Ok(None);
    }
    if node.has_tag_name("connect") {
        return connect(node).map(Some);
    }
    if !node.has_tag_name("joint") {
        return Ok(Some(Equality::LeftOut(
            "of equalities an arm file has joints that follow and loops of hinges",
        )));
    }
    let [offset, ratio, curve @ ..] = coefficients(node)?;
    let name = |key: &str| node.attribute(key).unwrap_or("").to_string();
    let (joint, leader) = (name("joint1"), name("joint2"));
    Ok(Some(if leader.is_empty() {
        Equality::Stands { joint, offset }
    } else if curve.iter().any(|x| *x != 0.0) {
        Equality::LeftOut("its joint follows by a curve, not by a straight line")
    } else {
        Equality::Follows { joint, leader, offset, ratio }
    }))
}

fn connect(node: Node<'_, '_>) -> Result<Equality, String> {
    let name = |key: &str| node.attribute(key).map(str::to_string);
    let sites = name("site1").zip(name("site2")).map(|(one, other)| [one, other]);
    let wrong = || "anchor of <connect> must be 3 numbers".to_string();
    let anchor = match (node.attribute("anchor"), &sites) {
        (Some(text), _) => finite(text).and_then(|n| n.try_into().ok()).ok_or_else(wrong)?,
        (None, Some(_)) => [0.0; 3],
        (None, None) => return Err(wrong()),
    };
    let body = |key: &str| name(key).unwrap_or_else(|| WORLD.to_string());
    Ok(Equality::Connects { bodies: [body("body1"), body("body2")], sites, anchor })
}

/// Of the polynomial by which a joint follows another.
fn coefficients(node: Node<'_, '_>) -> Result<[f64; 5], String> {
    let mut all = [0.0, 1.0, 0.0, 0.0, 0.0];
    let Some(text) = node.attribute("polycoef") else { return Ok(all) };
    let numbers = finite(text).filter(|n| n.len() <= all.len());
    let wrong = || format!("polycoef of <joint> must be up to 5 numbers, found '{text}'");
    all.iter_mut().zip(numbers.ok_or_else(wrong)?).for_each(|(to, x)| *to = x);
    Ok(all)
}
