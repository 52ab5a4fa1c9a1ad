//! No threads.

use super::Work;

/// A thread, of which there is none.
#[derive(Debug)]
pub enum Running {}

/// None begins.
///
/// # Safety
/// Always safe; as where there are threads.
pub unsafe fn launch(_: Work<'_>) -> Option<Running> {
    None
}
