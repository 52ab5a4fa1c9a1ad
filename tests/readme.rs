//! The program in the README is the one in `examples/c`, which is built and run.

#[test]
fn the_readme_shows_the_example() {
    let readme = include_str!("../README.md");
    let block = readme.split("```c\n").nth(1).and_then(|b| b.split("```").next()).unwrap();
    assert_eq!(block, include_str!("../examples/c/friction.c"), "copy examples/c/friction.c into README.md");
}
