mod correction;
mod measured;
mod model;
mod names;
mod planar;
mod plant;
mod repeats;
mod soft_gear;
