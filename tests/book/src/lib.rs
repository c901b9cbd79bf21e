//! Tests of the book and of what is published: see `tests/book/tests`.
