//! What a linker has to be told of symbols that the interpreter has: on macOS that they come later.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
