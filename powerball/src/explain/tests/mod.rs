mod plant;
mod study;
