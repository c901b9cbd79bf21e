//! The book and what is published: links, paths and fences; keys and messages in the reference pages; manifests and licences.
//!
//! A separate package, because nothing else needs the renderer of the book, which is half of the packages of the tests.

mod book;
mod notice;
mod published;
mod reference;
