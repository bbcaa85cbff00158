//! host-fit
fn main(){}
