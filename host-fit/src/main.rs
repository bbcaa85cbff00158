//! host-fit
fn main() {}
