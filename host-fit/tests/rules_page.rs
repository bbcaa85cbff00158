//! The page of rules is what the code says: `BLESS=1 cargo test --release -p host-fit --test rules_page` writes it anew.

use std::path::Path;

#[test]
fn the_page_states_the_rules_in_force() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/rules.md");
    let rules = host_fit::steps::rules_page();
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&page, &rules).expect("the page can be written");
    }
    let stated = std::fs::read_to_string(&page).unwrap_or_default();
    assert!(
        stated == rules,
        "docs/rules.md does not state the rules in force; write it anew with BLESS=1"
    );
}
