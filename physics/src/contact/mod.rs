//! What lies on the wrong side: garment vertices inside the body, outer layers below inner ones.

mod order;
mod penetration;

pub use order::{ORDER_RADIUS, OrderViolations, order_violations};
pub use penetration::{Penetration, penetration};
