mod measured;
mod plant;
mod study;
