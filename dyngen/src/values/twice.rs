//! Keys that occur twice in one object of a JSON text: readers silently take one of the two values.

use std::collections::BTreeMap;

/// An object or a list that is open, with the keys that it had so far.
enum Open<'t> {
    Object(BTreeMap<&'t str, usize>),
    List,
}

/// Line, column and message for each key that its object has already; `text` must be valid JSON.
pub(super) fn keys(text: &str) -> Vec<(usize, usize, String)> {
    let mut open: Vec<Open<'_>> = Vec::new();
    let mut found = Vec::new();
    let mut rest = text.char_indices().peekable();
    let (mut line, mut start) = (1, 0);
    while let Some((at, c)) = rest.next() {
        match c {
            '\n' => (line, start) = (line + 1, at + 1),
            '{' => open.push(Open::Object(BTreeMap::new())),
            '[' => open.push(Open::List),
            '}' | ']' => {
                open.pop();
            }
            '"' => {
                let mut end = at + 1;
                while let Some((i, c)) = rest.next().filter(|(_, c)| *c != '"') {
                    end = i + c.len_utf8();
                    if c == '\\' {
                        end = rest.next().map_or(end, |(i, c)| i + c.len_utf8());
                    }
                }
                while rest.next_if(|(_, c)| *c == ' ' || *c == '\t').is_some() {}
                let key = &text[at + 1..end];
                let is_key = rest.peek().is_some_and(|(_, c)| *c == ':');
                if let (true, Some(Open::Object(seen))) = (is_key, open.last_mut())
                    && let Some(first) = seen.insert(key, line)
                {
                    let column = text[start..at].chars().count() + 1;
                    let message =
                        format!("'{key}' is given twice, also in line {first}: which value is meant?");
                    found.push((line, column, message));
                }
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::keys;

    #[test]
    fn a_key_that_stands_twice_is_reported_with_its_place() {
        assert_eq!(keys(r#"{"a": 1, "b": ["a", "a"], "c": {"a": "b"}, "d\\\"": "\"a\": }{"}"#), []);
        let found = keys("{\"m1\": 1,\n  \"m2\": {\"x\": [1], \"x\" : 2},\n \"m1\" : 2}");
        let places: Vec<(usize, usize)> = found.iter().map(|(line, column, _)| (*line, *column)).collect();
        assert_eq!(places, [(2, 20), (3, 2)]);
        assert!(found[1].2.contains("'m1'") && found[1].2.contains("line 1"), "{found:?}");
    }
}
