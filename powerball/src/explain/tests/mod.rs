mod correction;
mod measured;
mod plant;
mod study;
