//! palpate-python
