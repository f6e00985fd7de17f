// No arm, two arms, files that are not there, a path with more behind it, a value of another type.
mod none {
    dyngen_macros::arm! { functions = [gravity] }
}
mod two {
    dyngen_macros::arm! { file = "arms/slider.toml", toml = "name = 1" }
}
mod gone {
    dyngen_macros::arm!("arms/nowhere.toml");
}
mod lost {
    dyngen_macros::arm! { file = "arms/slider.toml", values = "arms/nowhere.json" }
}
mod other {
    dyngen_macros::arm! { file = "arms/slider.toml", values = "arms/slider.toml" }
}
mod more {
    dyngen_macros::arm!("arms/slider.toml", full);
}
mod number {
    dyngen_macros::arm! { file = 3 }
}

fn main() {}
