//! Indri, Trapani and Lazzero, "Development of a Virtual Collision Sensor for Industrial Robots",
//! Sensors 17(5):1148, 2017.
//!
//! Detects collisions joint by joint from the measured effort and the expected effort of any model: the residue
//! (equation 1) is compared with a threshold of model error and bias (equations 4 to 11 and 17). No URDF is needed.
//!
//! - [`virtual_collision_sensor_basic`]: the bias is constant.
//! - [`virtual_collision_sensor`]: the bias is learnt and adapts (equations 12 to 16).

pub mod virtual_collision_sensor;
pub mod virtual_collision_sensor_basic;
