mod correction;
mod measured;
mod model;
mod names;
mod on_virtual_arm;
mod plant;
mod repeats;
mod small_arms;
