//! `docs/errors.md` is written from the tables, and must be that of the tables. `make docs` writes it.

use super::report::OUTCOMES;
use super::status::{swb_status, STATUS};
use std::fmt::Write as _;
use std::path::Path;

/// What the caller can do about a status.
fn remedy(status: swb_status) -> &'static str {
    use swb_status::*;
    match status {
        SWB_OK => "",
        SWB_ERR_NULL => "Pass the pointer that the message names.",
        SWB_ERR_DIMENSION => "Compare sizes and indices with those of the object; the message has both numbers.",
        SWB_ERR_RANGE => "Correct the value the message names: NaN, bounds the wrong way round, unsorted patterns ...",
        SWB_ERR_STATE => {
            "Call in another order: initialise settings, set before use, solve before get; do not use an object while \
             it works, or after it was freed."
        }
        SWB_ERR_UNSUPPORTED => "Choose another combination of options, or a library of the version of the header.",
        SWB_ERR_OPTION => "Correct the name (the message has the nearest one) or the type of the value.",
        SWB_ERR_USER => "The user function decided so; its code is in `swb_last_user_code()`.",
        SWB_ERR_NONFINITE => {
            "Start where the functions are defined, tighten bounds, declare the dependence on time; the message names \
             the function."
        }
        SWB_ERR_INTERRUPTED => "Call again.",
        SWB_ERR_NUMERIC => "Check scaling and derivatives (`swb_function_check_derivatives`).",
        SWB_ERR_LIBRARY => "Free memory, or install what the message names.",
        SWB_ERR_INTERNAL => "Free the object and report the message.",
    }
}

fn errors() -> String {
    let mut s = String::from(
        "# Status codes and outcomes\n\n\
         Written by `make docs` from the tables of the library.\n\n\
         A call returns a status: 0, or a negative number that says why it could not do its work. In the second case\n\
         `swb_last_error()` of the same thread has a message, and nothing was written to outputs. How an algorithm\n\
         ended is an outcome.\n\n\
         ## Status\n\n\
         | number | name | meaning | what to do |\n|---:|---|---|---|\n",
    );
    for (status, name, message) in STATUS {
        let (name, message) = (name.to_str().unwrap(), message.to_str().unwrap());
        writeln!(s, "| {} | `{name}` | {message} | {} |", *status as i32, remedy(*status)).unwrap();
    }
    s += "\n## Outcome\n\n| number | name | `swb_outcome_name` | a point to use |\n|---:|---|---|---|\n";
    for (_, number, name) in OUTCOMES {
        let name = name.to_str().unwrap();
        let usable = match name {
            "solved" => "yes",
            "failed" => "no; the call returned the reason as status",
            "max_time" | "stopped" => {
                "the last iterate; of a search the best solution so far, where `cost` has a value"
            }
            "not_followed" => "a solution of the discretised problem that simulations of its controls do not follow",
            _ => "the last iterate",
        };
        writeln!(s, "| {} | `SWB_OUTCOME_{}` | {name} | {usable} |", *number as i32, name.to_uppercase()).unwrap();
    }
    s += "\n## Callbacks\n\n\
          User functions return 0, or a positive number where they are not defined. Values that are not finite count as\n\
          not defined, and the solver tries a shorter step. A negative number ends the call with `SWB_ERR_USER`, and no\n\
          user function is called again in that call. An iteration callback ends a solve by any number but 0, with the\n\
          outcome `SWB_OUTCOME_STOPPED`; so does an interrupt.\n";
    s
}

fn compare(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
    if std::env::var_os("SWB_WRITE_DOCS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == text, "docs/{name} is out of date: run `make docs` and commit it");
}

#[test]
fn errors_page_is_that_of_the_table() {
    compare("errors.md", &errors());
}
