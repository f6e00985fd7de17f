mod correction;
mod measured;
mod model;
mod plant;
mod study;
