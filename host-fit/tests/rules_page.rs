//! The pages of rules equal the code: `BLESS=1 cargo test --release -p host-fit --test rules_page` regenerates
//! them.

use std::path::Path;

#[test]
fn the_pages_state_the_rules_in_force() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    for (name, rules) in host_fit::steps::rules_pages() {
        let page = docs.join(&name);
        if std::env::var_os("BLESS").is_some() {
            std::fs::create_dir_all(page.parent().expect("a folder")).expect("the folder");
            std::fs::write(&page, &rules).expect("the page can be written");
        }
        let stated = std::fs::read_to_string(&page).unwrap_or_default();
        assert!(
            stated == rules,
            "docs/{name} does not state the rules in force; write it anew with BLESS=1"
        );
    }
}
