"""The story of a dub: its stages, in their order.

    person:  prepare -> check_source -> finetune -> refine_poses
    dub:     listen -> render -> composite -> check (-> sign, with a certificate)
    draft:   listen -> draft

Every stage declares its dependencies itself; see `dubbing.stages`. The planner, the runner, the
report and ``--force`` read the jobs that are made here. Nothing here imports torch.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.production.clip import PersonClip
from dubbing.production.dub import Dub
from dubbing.production.person import Person
from dubbing.stages.base import Prepared
from dubbing.stages.check import Check
from dubbing.stages.check_source import CheckSource
from dubbing.stages.composite import Composite, PersonOnFilm
from dubbing.stages.draft import Draft
from dubbing.stages.finetune import Finetune, LearnedClip
from dubbing.stages.listen import Listen
from dubbing.stages.prepare import Prepare
from dubbing.stages.refine_poses import RefinePoses
from dubbing.stages.render import Render
from dubbing.stages.sign import Sign
from dubbing.video.files import video_file

PERSON, DUB = "identity", "dub"  # kinds of jobs
STAGES = (
    Prepare,
    CheckSource,
    Finetune,
    RefinePoses,
    Listen,
    Render,
    Composite,
    Check,
    Sign,
    Draft,
)


def people_jobs(
    people: Iterable[Person], dubs: Sequence[Dub], work: Path, device: str = "auto"
) -> dict[str, Job]:
    """The jobs of people by name, with the films of the dubs that they are in.

    Of long clips and films those parts that are learned from and dubbed.

    Args:
        work: folder of the stages.
        device: auto, cpu or cuda.
    """
    made: dict[str, Job] = {}
    for person in people:
        films = [d.film_of(person) for d in dubs if d.cues and person in d.people]
        made[person.name] = person_job(person.for_dubs(), work, films, device)
    return made


def person_job(
    person: Person, work: Path, films: Iterable[PersonClip] = (), device: str = "auto"
) -> Job:
    """The stages of a person, once for all dubs, whose films have poses of their own."""
    folder = work / "identities" / person.name
    job = Job(PERSON, person.name, folder, "clips", blocked=person.clip.damaged)
    films = [film for film in films if not film.damaged]
    for clip in dict.fromkeys((*person.learned, *films)):
        job.add(Prepare.of(person, clip), clip.name)
        job.add(CheckSource.of(clip), clip.name)
    checks = {clip: job.stage(CheckSource, clip.name) for clip in person.learned}
    learned = [LearnedClip(prepared(job, clip), check) for clip, check in checks.items()]
    model = job.add(Finetune.of(person, learned, device))
    for clip in dict.fromkeys(films or [person.clip]):
        job.add(RefinePoses.of(person, clip, prepared(job, clip), model, device), clip.name)
    return job


def dub_job(
    dub: Dub, people: Mapping[str, Job], work: Path, device: str = "auto", name: str = ""
) -> Job:
    """The stages of a dub; none where its film or a sound is damaged.

    Args:
        people: the jobs of people, by name.
        name: of its folder; its own by default.
    """
    job = empty_job(dub, people, dub_folder(work, name or dub.name))
    if not dub.cues:
        return job
    on_film = {who.name: on_film_of(dub, who, people[who.name]) for who in dub.people}
    heads: dict[str, Stage] = {}
    for cue in dub.cues:
        of = on_film[cue.identity]
        speech = job.add(Listen.of(cue, dub.person(cue), dub.film.rate), cue.recorded)
        render = Render.of(dub, cue, of.prepared, of.model, of.poses, speech, of.learned, device)
        heads[cue.name] = job.add(render, cue.taken)
    video = job.add(Composite.of(dub, heads, on_film))
    first = dub.people[0]
    source = people[first.name].stage(CheckSource, dub.film_of(first).name)
    job.add(Check.of(dub, video, source))
    if dub.signer:
        models = {name: person.model for name, person in on_film.items()}
        job.add(Sign.of(dub, dub.signer, video, models))
    return job


def draft_job(dub: Dub, people: Mapping[str, Job], work: Path, device: str = "auto") -> Job:
    """The stages of the draft of a dub; see `dub_job`."""
    job = empty_job(dub, people, dub_folder(work, dub.name))
    speech: dict[str, Stage] = {
        cue.name: job.add(Listen.of(cue, dub.person(cue), dub.film.rate), cue.recorded)
        for cue in dub.cues
    }
    if speech:
        on_film = {who.name: on_film_of(dub, who, people[who.name]) for who in dub.people}
        job.add(Draft.of(dub, speech, on_film, device))
    return job


def empty_job(dub: Dub, people: Mapping[str, Job], folder: Path) -> Job:
    """The job of a dub, which waits for its people, without stages."""
    waits = tuple(people[person.name].label for person in dub.people)
    return Job(DUB, dub.name, folder, "cues", waits, dub.blocked)


def on_film_of(dub: Dub, person: Person, job: Job) -> PersonOnFilm:
    """The stages of a person that a dub reads."""
    learned = tuple(prepared(job, clip) for clip in person.for_dubs().learned)
    film = dub.film_of(person)
    poses = job.stage(RefinePoses, film.name)
    return PersonOnFilm(prepared(job, film), poses, learned, job.stage(Finetune))


def prepared(job: Job, clip: PersonClip) -> Prepared:
    """The prepared clip in the job of a person."""
    return Prepared(job.stage(Prepare, clip.name), clip.path)


def finished_video(job: Job) -> Path:
    """The video of a dub as it goes out: signed, if it is."""
    codec = job.stage(Composite).settings.codec
    return video_file([*job.all_of(Composite), *job.all_of(Sign)][-1].folder, codec)


def dub_folder(work: Path, name: str) -> Path:
    """Folder of the stages of a dub."""
    return work / "dubs" / name
