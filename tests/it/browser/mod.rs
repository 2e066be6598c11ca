//! Pages as people see them: opened from a disk in Chromium, clicked, dragged, typed at, and looked at.

mod chromium;
mod reports;
mod tab;
mod viewer;
