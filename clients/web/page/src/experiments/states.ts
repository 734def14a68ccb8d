/** The words of the states of an experiment. */
import { pb } from "../wire";

export const kStateNames: Record<pb.ExperimentState, string> = {
  [pb.ExperimentState.EXPERIMENT_STATE_UNSPECIFIED]: "unknown",
  [pb.ExperimentState.EXPERIMENT_STATE_QUEUED]: "queued",
  [pb.ExperimentState.EXPERIMENT_STATE_RUNNING]: "running",
  [pb.ExperimentState.EXPERIMENT_STATE_COMPLETED]: "completed",
  [pb.ExperimentState.EXPERIMENT_STATE_STOPPED]: "stopped by a limit",
  [pb.ExperimentState.EXPERIMENT_STATE_CANCELLED]: "cancelled",
  [pb.ExperimentState.EXPERIMENT_STATE_FAILED]: "failed",
};
