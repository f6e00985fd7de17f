//! Who wants to know what is being done.

use std::fmt;

/// What is told, in a few words, what a long computation is doing now. The default tells nobody.
#[derive(Clone, Copy, Default)]
pub struct Progress<'a>(Option<&'a (dyn Fn(&str) + Sync)>);

impl<'a> Progress<'a> {
    /// Tells this function.
    #[must_use]
    pub fn to(listener: &'a (dyn Fn(&str) + Sync)) -> Self {
        Progress(Some(listener))
    }

    /// Tells what is being done now.
    pub fn say(&self, what: &str) {
        if let Some(listener) = self.0 {
            listener(what);
        }
    }
}

impl fmt::Debug for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Progress(told)" } else { "Progress(nobody)" })
    }
}
