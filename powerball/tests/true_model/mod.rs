//! The virtual arm's true values as a model's file.

use dyngen::{Model, SetKind};
use powerball::controller::friction::TABLE_2;
use powerball::virtual_arm::lwa4p;
use serde_json::{Value, json};

/// With these terms, and its friction by a factor.
pub(crate) fn true_model(friction: f64, terms: Value) -> Value {
    let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
    let set = model.set(SetKind::Minimal).unwrap();
    let all: Vec<f64> = lwa4p::links().iter().flat_map(|b| b.parameters()).collect();
    let values = model.set_values(set, &all);
    let parameter = |(name, value)| json!({"name": name, "value": value, "std": 0.0, "relative_std": 0.0});
    let parameters: Vec<Value> = set.names().iter().zip(values).map(parameter).collect();
    let law = |(j, g): (usize, &[f64; 5])| {
        json!({"joint": j + 1, "gamma1": friction * g[0], "gamma2": g[1], "gamma3": friction * g[2], "gamma4": g[3],
            "gamma5": friction * g[4]})
    };
    let laws: Vec<Value> = TABLE_2.iter().enumerate().map(law).collect();
    json!({
        "arm": "powerball_lwa4p_hardware", "set": "minimal", "parameters": parameters, "friction": laws, "terms": terms,
    })
}
