//! Names of fields that files can hold.

use autosplats_cloud::Field;

/// Unique names without blanks and separators, different from those in `taken`.
pub(super) fn unique_names(fields: &[&Field], taken: &[&str]) -> Vec<String> {
    let mut names: Vec<String> = taken.iter().map(|&name| name.into()).collect();
    for field in fields {
        let unfit = |c: char| c.is_whitespace() || c.is_control() || matches!(c, ',' | ';' | '"' | '#');
        let mut name = field.name.replace(unfit, "_");
        while name.is_empty() || names.iter().any(|other| other.eq_ignore_ascii_case(&name)) {
            name.push('_');
        }
        names.push(name);
    }
    names.split_off(taken.len())
}
