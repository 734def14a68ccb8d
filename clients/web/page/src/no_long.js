// protobufjs takes plain numbers where there is no class for 64-bit integers: ticks and counts stay below 2^53.
export default null;
