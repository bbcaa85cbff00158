//! The designed law compared with standard controllers, on plants that differ from its model.

use crate::Task;
use crate::shell::{run, scenario};

pub(crate) const TASK: Task = Task {
    name: "bench-law",
    does: "compares the designed law with relay, PI, Smith predictor and open loop; --beyond: only the plants with \
         physics that the law's model lacks",
    run: |arguments| run(scenario("bench-law").args(arguments)),
};
