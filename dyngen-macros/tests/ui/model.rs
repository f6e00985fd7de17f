// The attribute wants a module, and a set that the arm has.
#[dyngen_macros::model("arms/slider.toml")]
struct Slider;

#[dyngen_macros::model(file = "arms/slider.toml", parameters = published)]
mod published {}

fn main() {}
