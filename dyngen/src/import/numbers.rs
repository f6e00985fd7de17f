//! Numbers in attributes.

/// The numbers of a list with spaces between them; none where one is no finite number.
pub(super) fn finite(text: &str) -> Option<Vec<f64>> {
    let number = |t: &str| t.parse().ok().filter(|x: &f64| x.is_finite());
    text.split_whitespace().map(number).collect()
}
