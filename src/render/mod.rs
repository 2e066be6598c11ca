//! L4: how a scene becomes a film.
