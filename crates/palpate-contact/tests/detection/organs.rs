//! The natural pose of real organs, where their meshes are at hand (`PALPATE_DATA`).

