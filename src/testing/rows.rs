//! What every registered kind must satisfy, whatever its family.

use crate::base::registry::{self, Node, ParamKind, Params, Row, Value};
use std::sync::Arc;

/// A member of a family, built from one of its row's sample parameters.
pub struct Built<T: ?Sized> {
    /// Kind and number of the sample, for messages.
    pub label: String,
    /// The member.
    pub it: Arc<T>,
}

/// Builds every sample of every row, checked as a scene file's nodes are.
pub fn built<T: ?Sized>(family: &str, table: &[Row<T>]) -> Vec<Built<T>> {
    let mut all = Vec::new();
    for row in table {
        let samples = (row.samples)();
        assert!(!samples.is_empty(), "{family} {}: no samples to test it by", row.kind);
        for (i, params) in samples.into_iter().enumerate() {
            let label = format!("{family} {} #{i}", row.kind);
            let node = node(row.kind, &params);
            let it = registry::build(family, table, &node).unwrap_or_else(|e| panic!("{label}: {e}"));
            all.push(Built { label, it });
        }
    }
    all
}

/// Names are unique, everything is documented, defaults are values that the kind takes, and whatever else a
/// parameter is given is an error that names it, never a panic.
pub fn check_rows<T: ?Sized>(family: &str, table: &[Row<T>]) {
    for (i, row) in table.iter().enumerate() {
        assert!(table[..i].iter().all(|r| r.kind != row.kind), "{family} {} is there twice", row.kind);
        assert!(!row.doc.is_empty() && row.params.iter().all(|p| !p.doc.is_empty()), "{}", row.kind);
        let sample = (row.samples)().swap_remove(0);
        for spec in row.params {
            let label = format!("{family} {} `{}`", row.kind, spec.name);
            let with = |value: Value| {
                let mut params = sample.clone();
                params.list.retain(|p| p.name != spec.name);
                params.with(spec.name, value)
            };
            let build = |params: &Params| registry::build(family, table, &node(row.kind, params)).map(drop);
            match spec.default {
                Some(text) => {
                    let default = build(&with(parse(text)));
                    assert!(default.is_ok(), "{label}: default {text}: {}", default.unwrap_err());
                }
                None => {
                    let mut params = sample.clone();
                    params.list.retain(|p| p.name != spec.name);
                    let error = build(&params).expect_err(&label).to_string();
                    assert!(error.contains(&format!("`{}`", spec.name)), "{label}: {error}");
                }
            }
            for value in odd_values() {
                // Even unchecked, a constructor must not panic.
                let _ = (row.build)(&with(value.clone()));
                let result = build(&with(value.clone()));
                if !may_take(spec.kind, &value) {
                    let error = result.expect_err(&label).to_string();
                    assert!(error.contains(&format!("`{}`", spec.name)), "{label}: {error}");
                }
            }
        }
        let unknown = sample.clone().with("no_such_parameter", Value::Number(1.0));
        let error =
            registry::build(family, table, &node(row.kind, &unknown)).err().expect("unknown parameter");
        assert!(error.to_string().contains("no_such_parameter"), "{error}");
    }
    let error =
        registry::build(family, table, &node("no_such_kind", &Params::new())).err().expect("unknown kind");
    assert!(error.to_string().contains("no_such_kind"), "{error}");
}

/// What a scene file would say.
pub fn node(kind: &str, params: &Params) -> Node {
    Node { kind: kind.to_owned(), params: params.clone(), ..Node::default() }
}

/// A default as the specifications write it.
fn parse(text: &str) -> Value {
    if let Ok(v) = text.parse() {
        return Value::Number(v);
    }
    if let Ok(v) = text.parse() {
        return Value::Bool(v);
    }
    if let Some(list) = text.strip_prefix('[').and_then(|t| t.strip_suffix(']')) {
        return Value::Numbers(list.split(',').map(|v| v.trim().parse().expect("a number")).collect());
    }
    Value::Text(text.to_owned())
}

fn odd_values() -> Vec<Value> {
    let number = [f64::NAN, f64::INFINITY, -1e300, 1e300, -1.0, 0.0, 1e-300, 0.5, 7e18].map(Value::Number);
    let mut all = Vec::from(number);
    all.extend([vec![], vec![1.0], vec![0.0; 2], vec![f64::NAN; 2], vec![1e300; 2]].map(Value::Numbers));
    all.extend([vec![f64::NAN; 3], vec![1e300; 3], vec![-1.0; 3], vec![1.0; 5]].map(Value::Numbers));
    all.extend([Value::Bool(true), Value::Text(String::new()), Value::Text("no_such_word".into())]);
    all
}

/// Whether a value of this type and range could be right for the declaration.
fn may_take(kind: ParamKind, value: &Value) -> bool {
    let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
    match (kind, value) {
        (ParamKind::Bool, Value::Bool(_)) | (ParamKind::Text, Value::Text(_)) => true,
        (ParamKind::Number { min, max }, Value::Number(v)) => (min..=max).contains(v),
        (ParamKind::Integer { min, max }, Value::Number(v)) => {
            v.fract() == 0.0 && (min as f64..=max as f64).contains(v)
        }
        (ParamKind::Vector, Value::Numbers(v)) => v.len() == 3 && finite(v),
        (ParamKind::Vector2, Value::Numbers(v)) => v.len() == 2 && finite(v),
        (ParamKind::Vector2, Value::Number(v)) => v.is_finite(),
        (ParamKind::Color | ParamKind::Texture, Value::Number(v)) => v.is_finite() && *v >= 0.0,
        (ParamKind::Color | ParamKind::Texture, Value::Numbers(v)) => {
            v.len() == 3 && finite(v) && v.iter().all(|x| *x >= 0.0)
        }
        _ => false,
    }
}
