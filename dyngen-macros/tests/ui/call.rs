// Every error of a call, and those of its arm, at once.
mod arm {
    dyngen_macros::arm! {
        file = "arms/broken.toml",
        parameters = smallest,
        functions = gravity,
        colour = "red",
        parameters = full,
    }
}

fn main() {}
