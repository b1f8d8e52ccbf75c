import { applyLook, setStyle } from "../state/edit";
import { look } from "../state/history";
import { strings } from "../strings";
import { type Offer, presetOffers, styleOffers, thumbnails } from "./thumbnails";

/** Styles and looks as pictures of the mesh that is open. */
export function Looks() {
  const style = String(look.value.keys["style"] ?? "auto");
  return (
    <div class="looks">
      <h2>{strings.looks.styles}</h2>
      <Grid offers={styleOffers()} current={`style-${style}`} pick={(offer) => setStyle(offer.name)} />
      <h2>{strings.looks.presets}</h2>
      <Grid offers={presetOffers()} current={null} pick={(offer) => applyLook(offer.id, offer.look)} />
    </div>
  );
}

interface Props {
  offers: Offer[];
  current: string | null;
  pick(offer: Offer): void;
}

function Grid({ offers, current, pick }: Props) {
  return (
    <ul class="thumbnails">
      {offers.map((offer) => {
        const url = thumbnails.value[offer.id];
        return (
          <li key={offer.id}>
            <button
              type="button"
              aria-pressed={current === null ? undefined : offer.id === current}
              data-test={offer.id}
              title={strings.looks.pick(offer.name)}
              onClick={() => pick(offer)}
            >
              <span class="thumbnail">{url && <img src={url} alt="" />}</span>
              <span class="thumbnail-name">{offer.name}</span>
            </button>
          </li>
        );
      })}
    </ul>
  );
}
