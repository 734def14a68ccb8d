/** What is told of an experiment whose data came. */
import { withUnit } from "../numbers";
import { pb } from "../wire";
import { Fetched, kMostBytes } from "./fetch";
import { identification } from "./request";
import { kStateNames } from "./states";

const kMost = `${kMostBytes >> 20} MiB`;

export function titleOf(info: pb.ExperimentInfo, what: string): string {
  return `Experiment ${info.id}, ${what}${info.label ? `: ${info.label}` : ""}`;
}

/** `experiment-1.csv`; a name that says so where the data are not all. */
export function fileNameOf({ info, isWhole }: Fetched, ending: string): string {
  return `experiment-${info.id}${isWhole ? "" : `-first-${kMost.replace(" ", "")}`}.${ending}`;
}

/** The sentence when the data have come. */
export function arrivalOf(fetched: Fetched): string {
  return `experiment ${fetched.info.id}: ${fetched.isWhole ? kStateNames[fetched.info.state] : shorteningOf(fetched.info)}`;
}

/** `first`: what its user does before the motor is identified, for which all data are needed. */
export function factsOf(axes: pb.IAxisDescription[], { info, isWhole }: Fetched, first: string): [string, string][] {
  const period = info.period_s as number;
  const command = identification(axes, info.axis as number, `experiment-${info.id}.mcap`);
  return [
    ["state", `${kStateNames[info.state]}${info.reason ? `: ${info.reason}` : ""}`],
    ["axis", axes[info.axis as number].name as string],
    ["length", `${withUnit((info.tick as number) * period, "s")} of ${withUnit((info.ticks as number) * period, "s")}, ${info.tick} ticks`],
    ["data", `${info.rows} rows of ${info.signals.length} signals, one every ${withUnit((info.decimation as number) * period, "s")}`],
    ...(isWhole ? [] : [["shortened", shorteningOf(info)] as [string, string]]),
    ["verdict", info.verdict?.sentence as string ?? ""],
    ["state hash", ((info.verdict?.state_hash ?? 0) as number | bigint).toString(16).padStart(16, "0")],
    ...(command === "" || !isWhole ? [] : [["identify", `${first}, then ${command}`] as [string, string]]),
  ];
}

function shorteningOf(info: pb.ExperimentInfo): string {
  return `the page has the first ${kMost}; drivebench experiment fetch ${info.id} has all`;
}
