//! palpate-solver
