import { render } from "preact";
import { App } from "./app/app";
import { begin } from "./app/begin";
import { compare, endCompare, startCompare } from "./compare/state";
import { close, openStored, startRecovery } from "./files/open";
import { startPictures } from "./picture/live";
import { startThumbnails } from "./picture/thumbnails";
import { restart } from "./state/history";
import { EMPTY } from "./state/look";
import { readFragment, startLink } from "./state/link";
import { chosenSize, format } from "./state/size";

/** Brings back what the address holds; without a mesh in it, the empty page. */
function restore(): void {
  const linked = readFragment(location.hash);
  if (!linked) {
    restart(EMPTY);
    endCompare();
    return close();
  }
  restart(linked.look);
  chosenSize.value = linked.size;
  format.value = linked.format;
  compare.value = linked.compare;
  void openStored(linked.mesh);
}

render(<App />, document.getElementById("app")!);
startPictures();
startThumbnails();
startCompare();
startRecovery();
startLink();
void begin();
restore();
addEventListener("hashchange", restore);
