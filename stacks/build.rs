//! zencan's object dictionary.

fn main() {
    if let Err(e) = zencan_build::build_node_from_device_config("NODE", "node.toml") {
        eprintln!("node.toml: {e}");
        std::process::exit(1);
    }
}
