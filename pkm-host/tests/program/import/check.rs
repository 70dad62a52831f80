//! `check`: everything that is wrong or doubtful, at once, and nothing of a good file.

use serde_json::Value;

use super::table::{Table, good};
use crate::common::{Folder, fixture, json, refused, run};
