//! palpate-contact
