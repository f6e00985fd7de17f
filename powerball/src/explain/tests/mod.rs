mod correction;
mod measured;
mod model;
mod plant;
mod repeats;
mod study;
