//! palpate-mechanics
