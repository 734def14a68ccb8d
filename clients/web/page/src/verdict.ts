/** What the verdict of a bench would be if it ended now, in the words of its final one. */
import { pb } from "./wire";

export interface Verdict {
  text: string;
  isGood: boolean;
}

export function verdictOf(status: pb.IStatus): Verdict {
  const late = status.late_ticks as number;
  const gaps = status.recording_gaps as number;
  const lost = gaps > 0 ? `; the recording lost ${gaps} entries and does not replay` : "";
  return { text: timing(status, late) + lost, isGood: late === 0 && gaps === 0 };
}

function timing(status: pb.IStatus, late: number): string {
  const ticks = status.tick as number;
  if (status.mode === pb.Mode.MODE_LOCKSTEP) return `lockstep exact so far: ${ticks} ticks`;
  if (status.mode === pb.Mode.MODE_FREE) return `free run exact so far: ${ticks} ticks`;
  const worst = `worst lateness ${((status.worst_lateness_s as number) * 1e6).toFixed(1)} us`;
  return late === 0 ? `real-time valid so far: ${ticks} ticks, none late, ${worst}`
    : `not real-time valid: ${late} of ${ticks} ticks late, ${worst}`;
}
