#include "app/lab/report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "app/files.h"
#include "app/lab/chart.h"

namespace tetpbd {

namespace {

constexpr const char* style = R"(
body{font-family:system-ui,sans-serif;max-width:1180px;margin:2em auto;padding:0 1em;color:#222}
table{border-collapse:collapse;font-size:14px;font-variant-numeric:tabular-nums}
td,th{border:1px solid #ccc;padding:.25em .6em;text-align:right}
th{cursor:pointer;background:#f2f2f2;position:sticky;top:0}th[data-down]::after{content:" "attr(data-down)}
svg{max-width:100%;height:auto}.snapshots img{width:24%}
.figures{display:flex;gap:20px;align-items:flex-start;margin-bottom:1.5em}.figures>div{flex:1 1 860px;min-width:0}
#card{flex:0 0 240px;position:sticky;top:12px;border:1px solid #ccc;border-radius:6px;padding:12px;min-height:260px}
#card dl{display:grid;grid-template-columns:auto auto;gap:2px 10px;margin:8px 0 0;font-size:13px}
#card dt{color:#666}#card dd{margin:0;text-align:right;font-variant-numeric:tabular-nums}
.film{width:240px;height:180px;background-size:cover;border-radius:3px}
tr.marked{font-weight:bold}tr.on td{background:#fff2c9}[data-row]{cursor:pointer}
circle.on{stroke:#000;stroke-width:2}rect.on{stroke:#000;stroke-width:3}
@media(max-width:900px){.figures{flex-wrap:wrap}#card{position:static}}
)";

constexpr const char* script = R"(
for (const table of document.querySelectorAll('table'))
  table.querySelectorAll('th').forEach((th, column) => th.onclick = () => {
    const up = th.dataset.down === '▼';
    for (const other of table.querySelectorAll('th')) delete other.dataset.down;
    th.dataset.down = up ? '▲' : '▼';
    const text = row => row.cells[column].textContent;
    const order = (a, b) => a === '' || b === '' ? (a === '') - (b === '')
      : (up ? -1 : 1) * (isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b);
    const body = table.tBodies[0];
    body.append(...[...body.rows].sort((a, b) => order(text(a), text(b))));
  });
const card = document.getElementById('card');
let playing;
function show(number) {
  const row = document.querySelector(`tr[data-row="${number}"]`);
  if (!card || !row || row.classList.contains('on')) return;
  for (const one of document.querySelectorAll('.on')) one.classList.remove('on');
  for (const one of document.querySelectorAll(`[data-row="${number}"]`)) one.classList.add('on');
  const list = document.createElement('dl'), film = document.createElement('div');
  row.closest('table').querySelectorAll('th').forEach((th, column) => {
    const text = row.cells[column].textContent;
    for (const [kind, what] of text === '' ? [] : [['dt', th.textContent], ['dd', text]])
      list.appendChild(document.createElement(kind)).textContent = what;
  });
  clearInterval(playing);
  if (row.dataset.film) {
    film.className = 'film';
    const picture = new Image();
    picture.onload = () => {
      const frames = picture.naturalWidth / 240;
      let frame = frames - 1, wait = 3;
      const draw = () => film.style.backgroundPosition = `${-240 * frame}px 0`;
      film.style.backgroundImage = `url(${row.dataset.film})`;
      draw();
      playing = setInterval(() => {
        if (frame === frames - 1 && wait-- > 0) return;
        frame = (frame + 1) % frames, wait = 4;
        draw();
      }, 350);
    };
    picture.src = row.dataset.film;
  } else {
    film.textContent = 'no picture of this row';
  }
  card.replaceChildren(film, list);
}
for (const one of document.querySelectorAll('[data-row]')) {
  one.onmouseenter = () => show(one.dataset.row);
  one.onclick = () => location.hash = 'row=' + one.dataset.row;
}
const named = () => show(location.hash.replace('#row=', ''));
addEventListener('hashchange', named);
named();
)";

}  // namespace

std::string base64(const std::string& bytes) {
  static constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned value = 0;
    for (std::size_t k = 0; k < 3; ++k)
      value = value << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) result += i + k > bytes.size() ? '=' : letters[value >> (18 - 6 * k) & 63];
  }
  return result;
}

std::string page(const std::string& title, const std::string& body) {
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + escaped(title) +
         "</title><style>" + style + "</style></head><body>\n" + body + "<script>" + script +
         "</script></body></html>\n";
}

std::string software_note(bool software) {
  return software ? " <b>A software renderer on a CPU: no time below is a GPU's.</b>" : "";
}

std::string data_uri(const std::filesystem::path& png) {
  std::ifstream stream(png, std::ios::binary);
  if (!stream) return {};
  return "data:image/png;base64," + base64({std::istreambuf_iterator<char>(stream), {}});
}

std::string html_table(const std::vector<std::string>& titles, const std::vector<PageRow>& rows, bool shown) {
  std::string html = fmt::format("<table><thead><tr><th>{}</th></tr></thead><tbody>\n", fmt::join(titles, "</th><th>"));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    html += fmt::format("<tr{}{}{}>", rows[i].marked ? " class=\"marked\"" : "",
                        shown ? fmt::format(" data-row=\"{}\"", i) : "",
                        rows[i].film.empty() ? "" : " data-film=\"" + rows[i].film + "\"");
    for (const std::string& text : rows[i].cells) html += "<td>" + escaped(text) + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

Film::Film(const Scene& scene, const Model& model, const std::filesystem::path& out, std::size_t number,
           std::size_t rows)
    : folder(out),
      name(fmt::format("films/{:04}.png", number)),
      frames(rows > 400 ? 0 : std::clamp<std::size_t>(240 / rows, 1, 6)),
      renderer(make_renderer(model)),
      target(make_target(width, height, 4)),
      camera(scene_camera(scene, model, float(width) / float(height))),
      strip{width * int(frames), height, std::vector<std::uint8_t>(std::size_t(width) * height * 4 * frames)} {
  make_output_folder(out / "films");
}

std::function<void(const Sim&, long)> Film::of(long steps) {
  return [this, steps](const Sim& sim, long step) {
    while (drawn < frames && (frames == 1 ? step == steps : step * long(frames - 1) >= long(drawn) * steps)) {
      Frame frame = make_frame(sim, camera, {}, target);
      draw(renderer, frame);
      const Image image = read_rgba(target);
      constexpr std::size_t line = std::size_t(width) * 4;
      for (std::size_t y = 0; y < std::size_t(height); ++y)
        std::copy_n(&image.rgba[y * line], line, &strip.rgba[(y * frames + drawn) * line]);
      ++drawn;
    }
  };
}

ordered_json Film::write() {
  if (drawn == 0) return nullptr;
  Image done{width * int(drawn), height, {}};  // of a run that ended early
  for (std::size_t y = 0; y < std::size_t(height); ++y) {
    const auto line = strip.rgba.begin() + long(y * std::size_t(strip.width) * 4);
    done.rgba.insert(done.rgba.end(), line, line + long(done.width) * 4);
  }
  write_png(folder / name, done);
  return name.string();
}

void write_report(const Sweep& sweep, const std::filesystem::path& out, const ordered_json& document,
                  const std::string& figures) {
  const auto columns = table_columns(sweep);
  std::vector<std::string> titles;
  for (const TableColumn& column : columns) titles.push_back(escaped(column.title));
  std::vector<PageRow> rows;
  for (const auto& row : document["rows"]) {
    PageRow& made = rows.emplace_back();
    for (const TableColumn& column : columns) made.cells.push_back(text_of(cell(row, column.key)));
    if (row.contains("film") && row["film"].is_string()) made.film = data_uri(out / row["film"].get<std::string>());
    made.marked = row.contains("pareto") && row["pareto"] == true;
  }
  const ordered_json& device = document["device"];
  const std::filesystem::path file = out / (sweep.name + ".html");
  write_file(file, page("tetpbd " + sweep.name,
                        fmt::format(
                            "<p><code>tetpbd {}</code> on {}, OpenGL {}.{}</p>\n<div class=\"figures\"><div>{}</div>"
                            "<aside id=\"card\">Rest the cursor on a point or a row: its settings, its numbers, "
                            "and how it ends.</aside></div>\n",
                            sweep.name, escaped(text_of(device["gl_renderer"])), escaped(text_of(device["gl_version"])),
                            software_note(device["software"] == true), figures) +
                            html_table(titles, rows, true)));
  fmt::print("{}\n", file.string());
}

}  // namespace tetpbd
