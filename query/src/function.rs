//! The table function `replay`.

use std::path::Path;
use std::sync::Arc;

use datafusion::catalog::{TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::plan_err;
use datafusion::error::Result;

use crate::asked::literal;
use crate::replay::Loaded;
use crate::scan::{Kind, external};
use crate::sources;
use crate::table::ArchiveTable;

/// The table function `replay`. Its arguments are the pipeline file, the recordings and, if the pipeline has several
/// sources, the source that the recordings replace.
#[derive(Debug)]
pub struct ReplayFunction;

impl TableFunctionImpl for ReplayFunction {
    fn call_with_args(&self, args: TableFunctionArgs) -> Result<Arc<dyn TableProvider>> {
        let texts: Option<Vec<String>> = args.exprs().iter().map(literal).collect();
        let (pipeline, pattern, source) = match texts.as_deref() {
            Some([pipeline, pattern]) => (pipeline, pattern, None),
            Some([pipeline, pattern, source]) => (pipeline, pattern, Some(source.clone())),
            _ => {
                return plan_err!(
                    "replay takes a pipeline file and recordings: replay('pipeline.yaml', '*.mcap')"
                );
            }
        };
        let path = std::path::absolute(pipeline)?;
        let loaded = Loaded::load(Path::new(pipeline))?;
        // Reports errors before anything is read.
        loaded.replay(source.as_deref())?;
        Ok(Arc::new(ArchiveTable {
            kind: Kind::Replay {
                pipeline: path,
                source,
                identity: loaded.identity.hash(),
            },
            recordings: sources::recordings(pattern).map_err(external)?,
        }))
    }
}
