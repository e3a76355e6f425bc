//! Every setting, with its default and its environment variable.
