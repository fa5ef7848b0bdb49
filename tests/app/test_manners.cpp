// What the command line says of words it does not know, and of flags that change nothing.
#include <doctest/doctest.h>
#include <fcntl.h>

#include <thread>

#include "app/lab/run.h"
#include "sim/model/did_you_mean.h"
#include "tests/app/run_program.h"

using namespace tetpbd;
using namespace run_program;

TEST_CASE("did you mean: the nearest word, where one is near") {
  const std::vector<std::string> known{"colour", "steps", "substeps", "bunny-drop", "node"};
  CHECK(did_you_mean("color", known) == "did you mean 'colour'? ");
  CHECK(did_you_mean("step", known) == "did you mean 'steps'? ");
  CHECK(did_you_mean("sbustep", known) == "did you mean 'substeps'? ");
  CHECK(did_you_mean("bunny", known) == "did you mean 'bunny-drop'? ");
  CHECK(did_you_mean("ndoe", known) == "did you mean 'node'? ");
  CHECK(did_you_mean("magic", known) == "");
  CHECK(did_you_mean("", known) == "");
  CHECK(did_you_mean(std::string(5000, 'x'), known) == "");
}

TEST_CASE("manners: words that are not known get the one that was meant") {
  const Folder folder;
  const auto refused = [&](const std::string& words, const std::string& said) {
    const Outcome outcome = program(words, folder);
    CAPTURE(words);
    CAPTURE(outcome.err);
    CHECK(outcome.status == 2);
    CHECK(outcome.err.find(said) != std::string::npos);
  };
  refused("run --color volume", "did you mean '--colour'?");
  refused("run --step 5 --mode node", "not known here: --step 5: tetpbd run: did you mean '--steps'?");
  refused("rnu", "did you mean 'run'?");
  refused("compare --png-every 5", "it is an option of tetpbd run");
  refused("run a b c", "not known here: a b c");
  refused("run --scene bunny-drp", "did you mean 'bunny-drop'?");
  refused("run --scene hard/nope", "hard/needle");
  refused("run --scene hard/twisted", "did you mean 'hard/twisted-720'?");
  refused("run --scene published/sofa-bean", "did you mean 'published/sofa-beam'?");
  refused("run --mode cpu-fsat", "did you mean 'cpu-fast'?");
  refused("run --look wires", "did you mean 'wire'?");
  refused("run --solver substep", "did you mean 'substeps'?");
  refused("run --set solver.omga=1", "did you mean 'omega'?");
  refused("map --x omga=1,2", "did you mean 'omega'?");
  refused("compare --hard-cases --iterations 3", "--iterations");
  refused("run --replay x.jsonl --mode node", "--mode");
  refused("run --replay x.jsonl --explain", "--explain");
}

TEST_CASE("manners: flags that change nothing say so, others do not, both spellings of scenes are known") {
  const Folder folder;
  const std::string beam = "--scenes beam --steps 1 --set bodies.0.block.cells=[2,1,1] --out o ";
  const auto said = [&](const std::string& words) {
    const Outcome outcome = program("run " + beam + words, folder);
    CAPTURE(outcome.err);
    CHECK(outcome.status == 0);
    return outcome.err;
  };
  CHECK(said("--mode node --omega 1.2 --substeps 3 --k-bend 0.5") == "");
  CHECK(said("--mode cpu --omega 1.2") == "tetpbd: --omega changes nothing: mode cpu averages nothing\n");
  CHECK(said("--mode node --stability 0.3").find("--stability changes nothing: it is of mode explicit") !=
        std::string::npos);
  CHECK(said("--mode explicit --material springs --iterations 3 --substeps 3 --k-stretch 0.5") ==
        "tetpbd: --k-stretch changes nothing: the material stands in its place\n"
        "tetpbd: --iterations changes nothing: mode explicit has no iterations\n");
  CHECK(said("--mode node --young-modulus 1e5").find("there is no material") != std::string::npos);
  CHECK(said("--mode node --constraints stretch --k-bend 0.5").find("bend is not among") != std::string::npos);
  // On a CPU that pretends to be a GPU, a mode is taken that suits it, unless one is named.
  const Outcome chosen = program("run " + beam, folder), named = program("run --mode node " + beam, folder);
  const bool software = program("info", folder).out.find("software: a CPU") != std::string::npos;
  CHECK((chosen.out.find("solver: cpu-fast") != std::string::npos) == software);
  CHECK(named.out.find("solver:") == std::string::npos);
  const std::string help = program("run --help", folder).out;
  CHECK(help.find("cpu-fast: XPBD (Gauss-Seidel by colours)") != std::string::npos);
}

TEST_CASE("progress: where there is no terminal, a line at most every so often, the first after a while") {
  const Folder folder;
  const fs::path file = folder.path / "said";
  const int before = dup(2), said = open(file.c_str(), O_CREAT | O_WRONLY, 0600);
  dup2(said, 2);
  {
    Progress progress("filling a.obj, per cent:", 100, false, 10, 0.3);
    progress.update(10);
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    for (const long done : {50, 60}) progress.update(done);
  }
  dup2(before, 2);
  close(before), close(said);
  CHECK(read(file) == "filling a.obj, per cent: 50 of 100, 0 s left\n");
}

TEST_CASE("manners: frames of an earlier run go, odd videos are padded, long names are told, maps take steps") {
  const Folder folder;
  const std::string small = " --scene beam --set bodies.0.block.cells=[2,1,1] --out o --size 65x49 ";
  const auto frames = [&] {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(folder.path / "o")) count += entry.path().extension() == ".png";
    return count;
  };
  std::ofstream(folder.path / "notes.png") << "mine";
  CHECK(program("run --steps 4 --png-every 1" + small, folder).status == 0);
  CHECK(frames() == 5);
  fs::copy(folder.path / "notes.png", folder.path / "o" / "frame_notes.png");
  CHECK(program("run --steps 2 --png-every 2" + small, folder).status == 0);
  CHECK(frames() == 3);  // frame_00000, frame_00002, and what is none of ours
  CHECK(program("run --steps 2 --export vtk --positions-every 1" + small, folder).status == 0);
  CHECK(program("run --steps 2 --export vtk --positions-every 2" + small, folder).status == 0);
  CHECK(!fs::exists(folder.path / "o" / "vtk" / "frame_00001.vtu"));
  const Outcome odd = program("run --steps 8 --video odd.mp4" + small, folder);
  CHECK_MESSAGE(odd.status == 0, odd.err);
  CHECK(fs::file_size(folder.path / "odd.mp4") > 500);
  const std::string endless(300, 'a');
  for (const char* words :
       {"run --mesh {}.ply", "run --from-state {}", "run --camera-path {} --png-every 1", "run --shaders {}"}) {
    std::string line = words;
    line.replace(line.find("{}"), 2, endless);
    const Outcome outcome = program(line + " --steps 1", folder);
    CAPTURE(outcome.err);
    CHECK(outcome.status == 2);
    CHECK(outcome.err.find("File name too long") != std::string::npos);
    CHECK(outcome.err.find("unexpected") == std::string::npos);
  }
  const std::string beam = " --scene beam --set bodies.0.block.cells=[2,1,1] ";
  CHECK(program("map" + beam + "--x substeps=1,2 --y iterations=1,2 --steps 3 --out m", folder).status == 0);
  CHECK(read(folder.path / "m" / "map.json").find("\"seconds\": 0.01") != std::string::npos);
  CHECK(program("compare" + beam + "--modes node --mass-splitting true,false --steps 2 --judge volume --out c", folder)
            .status == 0);
  CHECK(read(folder.path / "c" / "compare.csv").size() > 100);
  // The same words for what varies everywhere.
  CHECK(program("map" + beam + "--vary substeps=1,2 --vary iterations=1:3:2 --steps 3 --out n", folder).status == 0);
  CHECK(read(folder.path / "n" / "map.csv").find("2,3,") != std::string::npos);
  CHECK(program("compare" + beam +
                    "--vary mode=node,cpu --vary substeps=1,2 --vary omega=1,1.5 --steps 2 --judge volume --out d",
                folder)
            .status == 0);
  const std::string rows = read(folder.path / "d" / "compare.csv");
  CHECK(std::count(rows.begin(), rows.end(), '\n') >= 7);
  const Outcome other = program("compare" + beam + "--vary density=1,2", folder);
  CHECK(other.status == 2);
  CHECK(program("compare" + beam + "--vary dt=0.001,0.002", folder).err.find("tetpbd map varies any") !=
        std::string::npos);
  CHECK(program("run --help", folder).out.find("or rubber, gelatine, muscle, foam, clay") != std::string::npos);
}
