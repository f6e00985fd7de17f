// Errors of an inline table carry the place inside the text.
mod arm {
    dyngen_macros::arm! {
        toml = r#"
            name = "pendulum"
            convention = "standard"
            gravity = [0, -9.81]
            [[joint]]
            kind = "revolute"
            a = "one"
            alpha = 0
            d = 0
        "#
    }
}

fn main() {}
