//! Indri, Trapani and Lazzero, "Development of a Virtual Collision Sensor for Industrial Robots",
//! Sensors 17(5):1148, 2017.

pub mod virtual_collision_sensor;
pub mod virtual_collision_sensor_basic;
