import { render } from "preact";
import { startPolling } from "./status/data";
import { Status } from "./status/status";

render(<Status />, document.getElementById("app")!);
startPolling();
