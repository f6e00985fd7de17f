mod correction;
mod measured;
mod model;
mod names;
mod plant;
mod repeats;
mod small_arms;
mod soft_gear;
